/**
 * The language of `.nsd` files, after `grammar/nsd.pest`.
 *
 * Words are keywords only where they stand: elsewhere the lexer takes them as identifiers. Where a name and a keyword may
 * begin alike, the word is a name, too, and what follows decides.
 */

/// <reference types="tree-sitter-cli/dsl" />
// @ts-check

const fs = require("fs");
const path = require("path");

const pest = fs.readFileSync(path.join(__dirname, "../../grammar/nsd.pest"), "utf8");

/** The words of a rule of the grammar. */
function words(rule) {
  const [, body] = new RegExp(`^${rule}\\s*=([^]*?)\\n(?=\\S)`, "m").exec(pest);
  const found = [...body.matchAll(/"([^"]+)"/g)].map(([, word]) => word);
  return found.map((word) => word.replace(/\\u\{(.*)\}/, (_, code) => String.fromCodePoint(parseInt(code, 16))));
}

const PREC = { if: 1, or: 2, and: 3, not: 4, compare: 5, add: 6, multiply: 7, unary: 8, power: 9, postfix: 10 };

const DECLARED = words("decl_kind");
const DEFINED = words("named_kind");
/** Words that begin statements where a name may begin one, too. */
const STATEMENTS = [...DECLARED, ...DEFINED, ..."const switch part region hidden project jump every mechanics contact from".split(" ")];
/** Words that begin what else begins with an expression. */
const LEADING = "phase title width mode status warning lowering numbers every at free".split(" ");

const list = (rule) => seq(rule, repeat(seq(",", rule)));
const block = (rule) => seq("{", repeat(rule), "}");
const ended = (...rules) => seq(...rules, ";");
const closed = (...rules) => seq(...rules, optional(";"));

module.exports = grammar({
  name: "nsd",
  word: ($) => $.identifier,
  extras: ($) => [/\s/, /\uFEFF/, $.doc_comment, $.comment],
  supertypes: ($) => [$._expression],
  conflicts: ($) => [
    [$._word_as_name, $.phase],
    [$._word_as_name, $._when],
    [$._word_as_name, $.horizon],
    [$._word_as_name, $.expectation],
    [$.unit_product],
    [$._known_factor],
    [$._comprehension],
    [$._word_as_name, $.width],
    [$._instants, $._word_as_path],
  ],
  rules: {
    source_file: ($) =>
      repeat(choice($.use, $.constant, $.function, $.model, $.experiment, $.expected_diagnostic)),

    doc_comment: () => token(prec(1, /\/\/\/[^\n]*/)),
    comment: () => token(/\/\/[^\n]*/),

    // --- Files

    use: ($) => ended("use", choice($.relative_path, $.dotted_path), optional(choice($.use_names, $._alias))),
    relative_path: () => token(/(\.\.?\/)+[\p{XID_Continue}-]+(\/[\p{XID_Continue}-]+)*/u),
    dotted_path: ($) => seq($.identifier, repeat(seq(".", $.identifier))),
    use_names: ($) => seq(alias(token(/\.\s*\{/), ".{"), list($.use_name), "}"),
    use_name: ($) => seq($.identifier, optional($._alias)),
    _alias: ($) => seq("as", field("alias", $.identifier)),
    constant: ($) => ended("const", field("name", $.identifier), "=", $._expression),
    function: ($) => ended("fn", field("name", $.identifier), $.parameters, "=", field("body", $._expression)),
    parameters: ($) => seq("(", optional(list($.identifier)), ")"),
    expected_diagnostic: ($) => ended("expect", choice(...words("severity")), $.identifier),

    // --- Models

    model: ($) => closed("model", field("name", $.identifier), field("body", $.body)),
    body: ($) => block($._statement),
    _statement: ($) =>
      choice(
        $.constant,
        $.declaration,
        $.definition,
        $.switch,
        $.part,
        $.region,
        $.hidden,
        $.projection,
        $.jump,
        $.sampled,
        $.mechanics,
        $.contact,
        $.loop,
        $.complementarity,
        $.equation,
        $.program,
        $.dynamics,
      ),
    declaration: ($) =>
      ended(
        field("kind", choice(...DECLARED)),
        field("name", $.identifier),
        optional($.sizes),
        optional(seq(":", $.unit)),
        optional($.domain),
        optional(seq("=", $._expression)),
      ),
    sizes: ($) => seq("[", list($._expression), "]"),
    unit: ($) => seq($._unit_factor, repeat(seq(choice("*", "/"), $._unit_factor))),
    _unit_factor: ($) =>
      seq(choice(alias($.identifier, $.unit_name), $.number, seq("(", $.unit, ")")), optional($.unit_power)),
    unit_power: ($) =>
      seq(
        "^",
        choice(
          seq(optional("-"), $.number),
          seq("(", optional("-"), $.number, optional(seq("/", $.number)), ")"),
        ),
      ),
    domain: ($) => seq("in", choice($.interval, $.set)),
    interval: ($) => seq("[", $._expression, ",", $._expression, "]"),
    set: ($) => seq("{", list($._expression), "}"),
    definition: ($) =>
      ended(
        field("kind", choice(...DEFINED)),
        field("name", $.identifier),
        optional(seq(":", $.unit)),
        "=",
        $._expression,
      ),
    switch: ($) =>
      ended(
        "switch",
        field("name", $.identifier),
        "=",
        $._expression,
        optional(seq("sliding", choice(...words("sliding")))),
      ),
    part: ($) =>
      seq(
        "part",
        field("name", $.identifier),
        optional(seq("[", $.binder, "]")),
        "=",
        field("model", $.path),
        choice(closed($.bindings), ";"),
      ),
    bindings: ($) => block($.binding),
    binding: ($) => ended($.path, "=", $._expression),
    binder: ($) => seq(field("name", $.identifier), "in", $._arithmetic, "..", $._arithmetic),
    region: ($) =>
      closed(
        "region",
        field("name", $.identifier),
        choice(seq("where", $._expression), seq("indicator", $._expression), "else"),
        $.body,
      ),
    hidden: ($) => closed("hidden", "on", $.path, $.body),
    projection: ($) =>
      seq("project", $.path, "onto", $.rows, choice(ended("metric", $._expression), optional(";"))),
    jump: ($) =>
      closed("jump", field("name", $.identifier), choice(seq("when", $._expression), $._instants), $.resets),
    sampled: ($) => prec.dynamic(1, closed($._instants, $.resets)),
    _instants: ($) => seq("every", $._expression, optional(seq("offset", $._expression))),
    resets: ($) => block($.reset),
    reset: ($) => ended($.path, ":=", $._expression),
    mechanics: ($) => closed("mechanics", $.path, ",", $.path, block(choice($.contact, $.option))),
    contact: ($) => closed("contact", field("name", $.identifier), $.options),
    options: ($) => block($.option),
    option: ($) => ended(field("name", choice($.identifier, alias($._word_as_path, $.identifier))), "=", $._expression),
    loop: ($) => closed("for", list($.binder), $.body),
    program: ($) =>
      seq(
        $._statement_path,
        "in",
        choice(
          seq("argmin", $._expression, choice(closed("subject", "to", $.rows), ";")),
          ended("variational", choice($.rows, $.interval), "solves", $._expression),
        ),
      ),
    rows: ($) => block($._row),
    _row: ($) => choice($.row_loop, $.relation),
    row_loop: ($) => closed("for", list($.binder), $.rows),
    relation: ($) =>
      ended($._arithmetic, repeat1(seq(choice("<=", ">=", "<", ">", "=", "perp"), $._arithmetic))),
    equation: ($) => ended($.number, "=", $._expression),
    complementarity: ($) => ended($.number, "<=", $._arithmetic, "perp", $._arithmetic, ">=", $.number),
    dynamics: ($) => ended($._statement_path, $.prime, choice("=", "+="), $._expression),
    prime: () => "'",
    path: ($) => seq($.identifier, repeat(choice($.field, $.index))),
    _path_in_body: ($) => seq(choice($.identifier, alias($._word_as_path, $.identifier)), repeat(choice($.field, $.index))),
    _path_in_output: ($) => seq($._name, repeat(choice($.field, $.index))),
    _statement_path: ($) => alias($._path_in_body, $.path),

    // --- Experiments

    experiment: ($) =>
      closed(
        field("kind", choice(...words("experiment_kind"))),
        field("name", $.identifier),
        "of",
        field("model", $.path),
        "{",
        repeat($._setting),
        "}",
      ),
    _setting: ($) =>
      choice(
        $.expectation,
        $.with,
        $.guess,
        $.method,
        $.horizon,
        $.record,
        $.lower,
        $.subject_to,
        $.final,
        $.initial,
        $.free,
        $.perturb,
        $.starts,
        $.chattering,
        $.stop,
        $.sensitivity,
        $.data,
        $.controller,
        $.plot,
        $.animate,
        $.intervals,
        $.value,
      ),
    with: ($) => closed("with", $.bindings),
    guess: ($) => closed("guess", block(choice($.guess_from, alias($._guessed, $.binding)))),
    _guessed: ($) => ended($._statement_path, "=", $._expression),
    guess_from: ($) => ended("from", choice($.string, $.path)),
    method: ($) => seq("method", field("name", $.identifier), choice(closed($.options), ";")),
    horizon: ($) =>
      ended(
        "horizon",
        choice(
          $._expression,
          prec.dynamic(1, seq("free", optional(seq("in", $.interval)), optional(seq("=", $._expression)))),
        ),
      ),
    record: ($) => ended("output", choice(prec.dynamic(1, $._when), seq(list(alias($._path_in_output, $.path)), optional($._when)))),
    _when: ($) => choice(seq("every", $._expression), seq("at", $._expression)),
    lower: ($) => ended("lower", list($.identifier)),
    subject_to: ($) =>
      seq("subject", "to", $.rows, choice(ended("at", $.identifier, optional($.soft)), ended($.soft), optional(";"))),
    soft: ($) => seq("soft", field("norm", $.identifier), "weight", $._expression),
    final: ($) => seq("final", $.rows, choice(ended($.soft), optional(";"))),
    initial: ($) => closed("initial", block(choice($.freed, $._row))),
    freed: ($) => ended($._primary, "free", optional($.domain)),
    free: ($) => closed("free", block($.free_parameter)),
    free_parameter: ($) => ended($.path, optional($.domain)),
    perturb: ($) => ended("perturb", "every", $._expression, optional($._by), optional($._seed)),
    starts: ($) => ended("starts", $._expression, optional($._by), optional($._seed)),
    _by: ($) => seq("by", $._expression),
    _seed: ($) => seq("seed", $.number),
    chattering: () => ended("on", "chattering", "slide"),
    stop: ($) => ended("stop", "when", $._expression),
    sensitivity: ($) => ended("sensitivity", "to", list($.sensed), optional("one_sided")),
    data: ($) => closed("data", $.string, optional(seq("with", $.bindings)), block($.measured)),
    measured: ($) => ended($.path, "->", field("column", choice($.identifier, $.string)), optional(seq("weight", $._expression))),
    controller: ($) => ended("controller", $.path),
    sensed: ($) => seq($.path, optional(seq("at", $.number))),
    plot: ($) => closed("plot", block(choice($.phase, $.title, $.width, $.panel))),
    panel: ($) => ended(list($._expression)),
    phase: ($) => prec.dynamic(1, ended("phase", $._expression, ",", $._expression)),
    title: ($) => ended("title", $.string),
    width: ($) => prec.dynamic(1, ended("width", optional("-"), $.number, $.length)),
    length: ($) => choice($.unit_name, alias("px", $.unit_name)),
    animate: ($) => closed("animate", block(choice($.title, $.width, $.drawing_loop, $.drawing))),
    drawing_loop: ($) => closed("for", list($.binder), block(choice($.drawing_loop, $.drawing))),
    drawing: ($) => ended(field("name", $.identifier), list($._expression)),
    intervals: ($) => ended("intervals", $._expression, "free"),
    value: ($) =>
      ended(
        choice(...words("value_name")),
        $._expression,
      ),
    expectation: ($) =>
      ended(
        "expect",
        choice(
          prec.dynamic(1, seq("lowering", "golden")),
          prec.dynamic(1, seq("numbers", "golden")),
          prec.dynamic(1, seq("mode", "at", $._arithmetic, "is", $._expression)),
          prec.dynamic(1, seq("status", "is", $.identifier)),
          prec.dynamic(1, seq("warning", choice($.identifier, alias(choice("at", "always"), $.identifier)))),
          seq(
            $._arithmetic,
            optional(choice($._instant, "always")),
            choice("~", "<=", ">=", "<", ">", "="),
            $._arithmetic,
            optional($._instant),
            optional(seq("within", $._arithmetic)),
          ),
        ),
      ),
    _instant: ($) => seq("at", $._arithmetic),

    // --- Expressions

    _expression: ($) => choice($.conditional, $.logical, $.negation, $.comparison, $._arithmetic),
    conditional: ($) =>
      prec.right(PREC.if, seq("if", $._expression, "then", $._expression, "else", $._expression)),
    logical: ($) =>
      choice(
        prec.left(PREC.or, seq($._expression, "or", $._expression)),
        prec.left(PREC.and, seq($._expression, "and", $._expression)),
      ),
    negation: ($) => prec(PREC.not, seq("not", $._expression)),
    comparison: ($) =>
      prec.left(PREC.compare, seq($._expression, choice("<=", ">=", "<", ">"), $._expression)),
    _arithmetic: ($) => choice($.binary, $.unary, $._primary),
    binary: ($) =>
      choice(
        prec.left(PREC.add, seq($._arithmetic, choice("+", "-"), $._arithmetic)),
        prec.left(PREC.multiply, seq($._arithmetic, choice("*", "/", ".*", "./"), $._arithmetic)),
        prec.right(PREC.power, seq($._arithmetic, choice("^", ".^"), $._arithmetic)),
      ),
    unary: ($) => prec(PREC.unary, seq("-", $._arithmetic)),
    _primary: ($) =>
      choice($.measure, $.string, $._operand),
    _operand: ($) => choice($.matrix, $.group, $._name, $.call, $.subscript, $.member),
    call: ($) => prec(PREC.postfix, seq(field("function", $._operand), $.arguments)),
    subscript: ($) => prec(PREC.postfix, seq($._operand, $.index)),
    member: ($) => prec(PREC.postfix, seq($._operand, $.field)),
    group: ($) => seq("(", $._expression, ")"),
    arguments: ($) => seq("(", optional(list($._argument)), ")"),
    _argument: ($) => choice($.named_argument, seq($._expression, optional($._comprehension))),
    named_argument: ($) => seq(field("name", $._name), "=", $._expression),
    _comprehension: ($) => seq("for", list($.binder)),
    matrix: ($) =>
      seq(
        "[",
        $._expression,
        choice(
          $._comprehension,
          seq(
            repeat(seq(",", $._expression)),
            repeat(seq(";", list($._expression))),
            optional(";"),
          ),
        ),
        "]",
      ),
    index: ($) => seq("[", list($._span), "]"),
    _span: ($) => choice(":", seq($._arithmetic, optional(seq("..", $._arithmetic)))),
    field: ($) => seq(".", alias($.identifier, $.property)),

    measure: ($) => seq($.number, optional(prec.dynamic(1, $.unit_product))),
    unit_product: ($) =>
      seq($._known_factor, repeat(prec.dynamic(1, seq(choice("*", "/"), $._known_factor)))),
    _known_factor: ($) =>
      seq(choice($.unit_name, seq("(", $.unit_product, ")")), optional($.unit_power)),
    unit_name: () => {
      const [prefix, unit] = [words("unit_prefix"), words("prefixed_unit")].map((all) => all.join("|"));
      return new RegExp(`${words("unit_word").join("|")}|(${prefix})?(${unit})`);
    },

    // --- Words and symbols

    _name: ($) => choice($.identifier, alias($._word_as_name, $.identifier)),
    _word_as_name: () => choice(...LEADING),
    _word_as_path: () => choice(...STATEMENTS),
    identifier: () => /[_\p{XID_Start}][\p{XID_Continue}]*/u,
    // `1..n` is a range, and `2.*x` a product entry by entry.
    number: () =>
      seq(
        /([0-9]+(\.[0-9]+)?|\.[0-9]+)([eE][+-]?[0-9]+)?/,
        optional(token.immediate(/\.([eE][+-]?[0-9]+)?/)),
      ),
    string: () => token(/"[^"\n]*"/),
  },
});
