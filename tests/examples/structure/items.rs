//! Sizes of types and functions.

use std::collections::BTreeMap;

use syn::visit::{self, Visit};

use super::imports::Names;
use super::sources::Source;

/// Names with their places, and their sizes.
#[derive(Default)]
pub struct Sizes {
    pub methods: Vec<(String, usize)>,
    pub fields: Vec<(String, usize)>,
    pub functions: Vec<(String, usize)>,
    pub tuples: Vec<(String, usize)>,
}

/// Sizes of everything that these files define.
pub fn of(sources: &[Source]) -> Sizes {
    let names = Names::of(sources);
    let mut methods: BTreeMap<String, usize> = BTreeMap::new();
    let mut sizes = Sizes::default();
    for source in sources {
        let mut seen = Seen {
            source,
            sizes: &mut sizes,
        };
        source.items.iter().for_each(|item| seen.visit_item(item));
        for item in &source.items {
            let syn::Item::Impl(block) = item else {
                continue;
            };
            let syn::Type::Path(of) = &*block.self_ty else {
                continue;
            };
            if block.trait_.is_none() {
                let path = of.path.segments.iter().map(|part| part.ident.to_string());
                let file = names.find(source, &path.collect::<Vec<_>>());
                let file = file.map_or_else(|| source.name(), |file| sources[file].name());
                let name = of.path.segments.last().expect("a path has a name");
                let is_method = |item: &&syn::ImplItem| matches!(item, syn::ImplItem::Fn(_));
                let count = block.items.iter().filter(is_method).count();
                *methods
                    .entry(format!("{} of {file}", name.ident))
                    .or_default() += count;
            }
        }
    }
    sizes.methods = methods.into_iter().collect();
    sizes
}

struct Seen<'a> {
    source: &'a Source,
    sizes: &'a mut Sizes,
}

impl Seen<'_> {
    fn function(&mut self, signature: &syn::Signature, body: &syn::Block) {
        let name = format!("{} of {}", signature.ident, self.source.name());
        let lines = self.source.lines_of(signature).max(1) + self.source.lines_of(body) - 1;
        for input in &signature.inputs {
            if let syn::FnArg::Typed(input) = input {
                self.sizes.tuples.push((name.clone(), entries(&input.ty)));
            }
        }
        self.sizes.functions.push((name, lines));
    }
}

impl<'ast> Visit<'ast> for Seen<'_> {
    fn visit_item_struct(&mut self, item: &'ast syn::ItemStruct) {
        let name = format!("{} of {}", item.ident, self.source.name());
        self.sizes.fields.push((name, item.fields.len()));
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.function(&item.sig, &item.block);
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.function(&item.sig, &item.block);
        visit::visit_impl_item_fn(self, item);
    }
}

/// Entries of a tuple, behind references.
fn entries(of: &syn::Type) -> usize {
    match of {
        syn::Type::Reference(of) => entries(&of.elem),
        syn::Type::Tuple(of) => of.elems.len(),
        _ => 1,
    }
}
