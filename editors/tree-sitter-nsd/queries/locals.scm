[
  (source_file)
  (function)
  (model)
  (body)
  (experiment)
  (loop)
  (row_loop)
  (drawing_loop)
  (arguments)
  (matrix)
] @local.scope

(model name: (identifier) @local.definition)
(function name: (identifier) @local.definition)
(constant name: (identifier) @local.definition)
(declaration name: (identifier) @local.definition)
(definition name: (identifier) @local.definition)
(switch name: (identifier) @local.definition)
(part name: (identifier) @local.definition)
(region name: (identifier) @local.definition)
(jump name: (identifier) @local.definition)
(contact name: (identifier) @local.definition)
(experiment name: (identifier) @local.definition)
(parameters (identifier) @local.definition)
(binder name: (identifier) @local.definition)

(identifier) @local.reference
