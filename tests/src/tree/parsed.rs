//! A crate parsed with `syn`: its modules with their definitions, imports and references. Tests are omitted.

use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syn::{Attribute, Item, UseTree, Visibility};

/// The path of a module in its crate: empty for the root.
pub(super) type ModulePath = Vec<String>;

/// A `use` of one name, or of all names of a module.
pub(super) struct Import {
    /// Its local name; `None` for a glob.
    pub alias: Option<String>,
    /// The path as written.
    pub target: Vec<String>,
    /// Whether the module exports it.
    pub is_public: bool,
}

/// A module: a file, or a module inside a file.
pub(super) struct Module {
    pub file: PathBuf,
    pub items: BTreeSet<String>,
    pub imports: Vec<Import>,
    /// Paths with at least two names in its code.
    pub names: Vec<Vec<String>>,
}

/// All modules of the crate with this root file.
pub(super) fn read_crate(root: &Path) -> BTreeMap<ModulePath, Module> {
    let mut modules = BTreeMap::new();
    let folder = root.parent().unwrap().to_owned();
    read_file(root, &folder, Vec::new(), &mut modules);
    modules
}

/// `folder`: location of the modules that the file declares.
fn read_file(file: &Path, folder: &Path, path: ModulePath, modules: &mut BTreeMap<ModulePath, Module>) {
    let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    read_items(parsed.items, file, folder, path, modules);
}

fn read_items(
    items: Vec<Item>,
    file: &Path,
    folder: &Path,
    path: ModulePath,
    modules: &mut BTreeMap<ModulePath, Module>,
) {
    let mut module =
        Module { file: file.to_owned(), items: BTreeSet::new(), imports: Vec::new(), names: Vec::new() };
    for item in items {
        if is_for_tests(attributes(&item)) {
            continue;
        }
        match item {
            Item::Mod(inner) => {
                let name = inner.ident.to_string();
                let inner_path = [path.clone(), vec![name.clone()]].concat();
                match inner.content {
                    Some((_, items)) => read_items(items, file, &folder.join(&name), inner_path, modules),
                    None => {
                        let (flat, nested) =
                            (folder.join(format!("{name}.rs")), folder.join(&name).join("mod.rs"));
                        let file = if flat.is_file() { flat } else { nested };
                        read_file(&file, &folder.join(&name), inner_path, modules);
                    }
                }
            }
            Item::Use(line) => {
                let is_public = !matches!(line.vis, Visibility::Inherited);
                imports(&line.tree, &mut Vec::new(), is_public, &mut module.imports);
            }
            item => {
                module.items.extend(name_of(&item));
                names(item.to_token_stream(), &mut module);
            }
        }
    }
    modules.insert(path, module);
}

/// Flattens a tree of imports into single imports.
fn imports(tree: &UseTree, before: &mut Vec<String>, is_public: bool, found: &mut Vec<Import>) {
    let mut import = |alias: Option<String>, target: Vec<String>| {
        found.push(Import { alias, target, is_public });
    };
    match tree {
        UseTree::Path(path) => {
            before.push(path.ident.to_string());
            imports(&path.tree, before, is_public, found);
            before.pop();
        }
        UseTree::Group(group) => {
            for tree in &group.items {
                imports(tree, before, is_public, found);
            }
        }
        UseTree::Glob(_) => import(None, before.clone()),
        UseTree::Name(name) if name.ident == "self" => import(before.last().cloned(), before.clone()),
        UseTree::Name(name) => {
            let name = name.ident.to_string();
            import(Some(name.clone()), [before.clone(), vec![name]].concat());
        }
        UseTree::Rename(renamed) => {
            let name = if renamed.ident == "self" { vec![] } else { vec![renamed.ident.to_string()] };
            import(Some(renamed.rename.to_string()), [before.clone(), name].concat());
        }
    }
}

/// Collects paths from tokens, so that macros are included. Imports inside functions count as imports of their module.
fn names(tokens: TokenStream, module: &mut Module) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            TokenTree::Ident(word) if *word == "use" => {
                let end = (at..tokens.len()).find(|i| is_punct(&tokens[*i], ';')).unwrap_or(tokens.len() - 1);
                let line: TokenStream = tokens[at..=end].iter().cloned().collect();
                if let Ok(line) = syn::parse2::<syn::ItemUse>(line) {
                    imports(&line.tree, &mut Vec::new(), false, &mut module.imports);
                }
                at = end + 1;
            }
            TokenTree::Ident(word) => {
                let mut path = vec![word.to_string()];
                at += 1;
                while at + 2 < tokens.len() && is_punct(&tokens[at], ':') && is_punct(&tokens[at + 1], ':') {
                    let TokenTree::Ident(word) = &tokens[at + 2] else { break };
                    path.push(word.to_string());
                    at += 3;
                }
                if path.len() > 1 {
                    module.names.push(path);
                }
            }
            TokenTree::Group(group) => {
                names(group.stream(), module);
                at += 1;
            }
            _ => at += 1,
        }
    }
}

fn is_punct(token: &TokenTree, character: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == character)
}

/// Whether one of the attributes is `cfg(test)`, alone or within `all`.
fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().filter(|attribute| attribute.path().is_ident("cfg")).any(|attribute| {
        let condition = attribute.meta.to_token_stream().to_string();
        condition.contains("test") && !condition.contains("not")
    })
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

fn name_of(item: &Item) -> Option<String> {
    Some(match item {
        Item::Const(item) => item.ident.to_string(),
        Item::Enum(item) => item.ident.to_string(),
        Item::Fn(item) => item.sig.ident.to_string(),
        Item::Macro(item) => item.ident.as_ref()?.to_string(),
        Item::Static(item) => item.ident.to_string(),
        Item::Struct(item) => item.ident.to_string(),
        Item::Trait(item) => item.ident.to_string(),
        Item::Type(item) => item.ident.to_string(),
        _ => return None,
    })
}
