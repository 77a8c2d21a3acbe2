; General first: what follows is more special, and wins.

(identifier) @variable
(property) @variable.member

(comment) @comment
(doc_comment) @comment.documentation
(string) @string
(relative_path) @string.special.path
(number) @number
(unit_name) @type.builtin
(prime) @operator

((identifier) @constant.builtin
  (#any-of? @constant.builtin "pi" "inf" "true" "false" "time"))

(call function: (identifier) @function.call)
(function name: (identifier) @function)
(parameters (identifier) @variable.parameter)
(named_argument name: (identifier) @variable.parameter)
(binder name: (identifier) @variable.parameter)

(model name: (identifier) @type)
(part model: (path . (identifier) @type))
(experiment name: (identifier) @function)
(experiment model: (path . (identifier) @type))
(dotted_path (identifier) @module)
(region name: (identifier) @label)
(jump name: (identifier) @label)
(contact name: (identifier) @label)
(option name: (identifier) @property)
(method name: (identifier) @constant)
(lower (identifier) @constant)
(soft norm: (identifier) @constant)
(measured column: (identifier) @property)
(drawing name: (identifier) @function.call)

[
  "model" "fn" "simulate" "optimize" "fit" "mpc" "const" "param" "state" "discrete" "control" "input"
  "algebraic" "let" "output" "signal" "switch" "part" "region" "jump" "contact"
] @keyword

[
  "always" "animate" "argmin" "at" "by" "chattering" "controller" "controls" "data" "deadline" "elements" "error" "every" "expect"
  "final" "free" "golden" "grid" "guess" "hidden" "horizon" "in" "indicator" "initial" "intervals" "is"
  "linear" "loss" "lower" "lowering" "mechanics" "method" "metric" "minimize" "mode" "nonlinear" "numbers"
  "of" "offset" "on" "one_sided" "onto" "perturb" "phase" "plot" "project" "runs" "sample" "scheme" "seed" "sensitivity" "slide"
  "sliding" "soft" "solves" "starts" "status" "stop" "subject" "title" "to" "tolerance" "variational" "warning" "weight" "when"
  "where" "width" "with" "within"
] @keyword

[
  "if" "then" "else"
] @keyword.conditional

[
  "for"
] @keyword.repeat

[
  "use" "as" "from"
] @keyword.import

[
  "and" "or" "not" "perp"
] @keyword.operator

[
  "+" "-" "*" "/" "^" ".*" "./" ".^" "<=" ">=" "<" ">" "=" "+=" ":=" "~" ".."
] @operator

["," ";" ":" "."] @punctuation.delimiter
["(" ")" "[" "]" "{" "}" ".{"] @punctuation.bracket
