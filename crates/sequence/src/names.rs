//! Finds unknown functions and properties before a script runs. Otherwise a rarely executed branch might fail in the middle of
//! a long run.

use mapper_yaml::closest;
use rhai::{AST, ASTNode, Engine, Expr, Position, Stmt};
use std::collections::{BTreeMap, BTreeSet};

/// Functions that the engine provides but does not list.
const KEYWORDS: [&str; 12] = [
    "print",
    "debug",
    "type_of",
    "is_def_var",
    "is_def_fn",
    "is_shared",
    "Fn",
    "call",
    "curry",
    "eval",
    "this",
    "parse_json",
];
/// The engine's name for the function that reads a property.
const GETTER: &str = "get$";

/// All callable names, with their numbers of arguments.
type FunctionTable = BTreeMap<String, BTreeSet<usize>>;

/// An unknown name: position, message and remedy.
pub(crate) struct UnknownName {
    pub(crate) at: Position,
    pub(crate) message: String,
    pub(crate) remedy: String,
}

/// Returns the first mistake of a script: a call of an unknown function, a wrong number of arguments, or an unknown
/// property.
pub(crate) fn check(engine: &Engine, ast: &AST) -> Result<(), UnknownName> {
    let mut functions = FunctionTable::new();
    let registered = |function: rhai::FuncInfo<'_>| {
        Some((function.metadata.name.to_string(), function.metadata.num_params))
    };
    for (name, count) in engine.collect_fn_metadata(None, registered, true) {
        functions.entry(name).or_default().insert(count);
    }
    for function in ast.iter_functions() {
        functions.entry(function.name.to_owned()).or_default().insert(function.params.len());
    }
    // A script's own maps may have any property.
    let mut has_maps = false;
    let mut problems: Vec<(Position, String, String)> = Vec::new();
    let mut property = None;
    ast.walk(&mut |path: &[ASTNode<'_>]| {
        match path.last() {
            Some(ASTNode::Expr(Expr::FnCall(call, at)) | ASTNode::Stmt(Stmt::FnCall(call, at)))
                if call.op_token.is_none() =>
            {
                problems
                    .extend(check_call(&functions, &call.name, call.args.len()).map(|(m, r)| (*at, m, r)));
            }
            // The value before the dot is the first argument.
            Some(ASTNode::Expr(Expr::MethodCall(call, at))) => {
                problems.extend(
                    check_call(&functions, &call.name, call.args.len() + 1).map(|(m, r)| (*at, m, r)),
                );
            }
            Some(ASTNode::Expr(Expr::Property(names, at)))
                if property.is_none() && !functions.contains_key(&format!("{GETTER}{}", names.2)) =>
            {
                property = Some((*at, names.2.to_string()));
            }
            Some(ASTNode::Expr(Expr::Map(..) | Expr::DynamicConstant(..))) => has_maps = true,
            _ => {}
        }
        true
    });
    if let Some((at, name)) = property.filter(|_| !has_maps) {
        let getters: Vec<&str> = functions.keys().filter_map(|name| name.strip_prefix(GETTER)).collect();
        problems.push((
            at,
            format!("no value of a sequence script has a property `{name}`"),
            remedy_for(&name, &getters),
        ));
    }
    problems.sort_by_key(|(at, ..)| (at.line(), at.position()));
    problems
        .into_iter()
        .next()
        .map_or(Ok(()), |(at, message, remedy)| Err(UnknownName { at, message, remedy }))
}

fn check_call(functions: &FunctionTable, name: &str, count: usize) -> Option<(String, String)> {
    if KEYWORDS.contains(&name) {
        return None;
    }
    let Some(counts) = functions.get(name) else {
        let names: Vec<&str> =
            functions.keys().map(String::as_str).filter(|name| !name.contains('$')).collect();
        return Some((format!("no function `{name}` exists for sequence scripts"), remedy_for(name, &names)));
    };
    if counts.contains(&count) {
        return None;
    }
    let allowed: Vec<String> = counts.iter().map(ToString::to_string).collect();
    let message = format!("`{name}` is called with {count} arguments, but takes {}", allowed.join(" or "));
    Some((message, SEE_REFERENCE.to_owned()))
}

pub(crate) const SEE_REFERENCE: &str = "docs/reference/sequences.md lists the functions and their arguments";

fn remedy_for(name: &str, known_names: &[&str]) -> String {
    match closest(name, known_names) {
        Some(guess) => format!("did you mean `{guess}`? {SEE_REFERENCE}"),
        None => SEE_REFERENCE.to_owned(),
    }
}
