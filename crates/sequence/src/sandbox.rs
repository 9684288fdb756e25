//! The rhai engine of a script: its restrictions and resource limits, and checks of the script before it runs. An unknown function or property in a
//! rarely executed branch might fail in the middle of a long run; the language treats the rest of a script as a comment if one is never closed,
//! so that steps would be lost.

use mapper_yaml::closest;
use rhai::packages::{
    ArithmeticPackage, BasicArrayPackage, BasicFnPackage, BasicIteratorPackage, BasicMapPackage,
    BasicMathPackage, BasicStringPackage, LogicPackage, MoreStringPackage, Package,
};
use rhai::{AST, ASTNode, Dynamic, Engine, EvalAltResult, Expr, Position, Stmt};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Operations of a whole script, including its closures: about one second of plain ones. Operations limit the computing time
/// independently of a clock, so that a script behaves the same on every machine.
pub(crate) const OPERATION_LIMIT: u64 = 5_000_000;
/// Depth of calls.
pub(crate) const CALL_DEPTH_LIMIT: usize = 32;
/// Depth of expressions.
const EXPRESSION_DEPTH_LIMIT: usize = 64;
/// Length of a string, bytes. `replace` may square this before it is measured.
const STRING_LIMIT: usize = 4096;
/// Elements of an array, including nested arrays; at least twice the grid.
const ARRAY_LIMIT: usize = 4096;
/// Entries of a map.
const MAP_LIMIT: usize = 1024;
/// Simultaneous variables.
const VARIABLE_LIMIT: usize = 128;
/// Functions of a script.
const FUNCTION_LIMIT: usize = 128;
/// Length of a script, bytes.
pub(crate) const SCRIPT_LIMIT: usize = 256 << 10;
/// Stack of a script's thread, bytes: room for values nested as deeply as an array is long.
pub(crate) const STACK_BYTES: usize = 256 << 20;

/// Operations used by a script, and a flag that ends it; shared by all its functions.
#[derive(Debug, Default)]
pub(crate) struct Budget {
    operations: AtomicU64,
    cancelled: AtomicBool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ScriptEnd {
    /// The script exceeded the limit of operations.
    OutOfOperations,
    /// The runner does not need it any more.
    Cancelled,
}

impl Budget {
    /// Ends the script at its next operation.
    pub(crate) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    pub(crate) fn count_operation(&self) -> Option<ScriptEnd> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Some(ScriptEnd::Cancelled);
        }
        let before = self.operations.fetch_add(1, Ordering::Relaxed);
        (before >= OPERATION_LIMIT).then_some(ScriptEnd::OutOfOperations)
    }
}

/// An engine with arithmetic, strings, arrays and maps only: no modules, no `eval`, no clock, no `sleep`.
pub(crate) fn build_engine(grid_points: usize, budget: &Arc<Budget>) -> Engine {
    let mut engine = Engine::new_raw();
    ArithmeticPackage::new().register_into_engine(&mut engine);
    LogicPackage::new().register_into_engine(&mut engine);
    BasicMathPackage::new().register_into_engine(&mut engine);
    BasicIteratorPackage::new().register_into_engine(&mut engine);
    BasicFnPackage::new().register_into_engine(&mut engine);
    BasicStringPackage::new().register_into_engine(&mut engine);
    MoreStringPackage::new().register_into_engine(&mut engine);
    BasicArrayPackage::new().register_into_engine(&mut engine);
    BasicMapPackage::new().register_into_engine(&mut engine);
    engine.disable_symbol("eval");
    // A value reached through `this` would bypass the measurement of variables below.
    engine.disable_symbol("this");
    // A function with arguments stored in it is not measured: `f = f.curry(f)` doubles it without limit.
    engine.disable_symbol("curry");
    let element_limit = ARRAY_LIMIT.max(2 * grid_points);
    // The engine measures the results of functions and operators, but not of `a[i] = b`, so that nested arrays
    // could multiply. Therefore each variable is measured whenever it is used.
    #[allow(deprecated, reason = "not deprecated but marked as open to change")]
    engine.on_var(move |name, _, context| {
        let room = context.scope().get(name).and_then(|value| room_after(value, element_limit));
        match room {
            None if context.scope().contains(name) => {
                Err(EvalAltResult::ErrorDataTooLarge("Size of array/map".to_owned(), Position::NONE).into())
            }
            _ => Ok(None),
        }
    });
    // The engine counts the operations of each closure call separately, so they are added up here.
    let budget = Arc::clone(budget);
    engine.on_progress(move |_| budget.count_operation().map(Dynamic::from));
    engine
        .set_max_call_levels(CALL_DEPTH_LIMIT)
        .set_max_expr_depths(EXPRESSION_DEPTH_LIMIT, EXPRESSION_DEPTH_LIMIT)
        .set_max_string_size(STRING_LIMIT)
        .set_max_array_size(element_limit)
        .set_max_map_size(MAP_LIMIT)
        .set_max_variables(VARIABLE_LIMIT)
        .set_max_functions(FUNCTION_LIMIT)
        .set_strict_variables(true)
        .set_fail_on_invalid_map_property(true);
    engine
}

/// Subtracts the elements of a value, including nested arrays and maps, from `room`; `None` if they do not fit.
fn room_after(value: &Dynamic, room: usize) -> Option<usize> {
    if let Ok(array) = value.as_array_ref() {
        let room = room.checked_sub(array.len())?;
        return array.iter().try_fold(room, |room, item| room_after(item, room));
    }
    if let Ok(map) = value.as_map_ref() {
        let room = room.checked_sub(map.len())?;
        return map.values().try_fold(room, |room, item| room_after(item, room));
    }
    Some(room)
}

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

/// Start of a block comment that does not end.
pub(crate) fn find_unclosed_comment(text: &str) -> Option<Position> {
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let rest = bytes.get(at..)?;
        at = match rest {
            [b'/', b'/', ..] => at + length_until(rest, b"\n"),
            [b'/', b'*', ..] => match block_length(rest) {
                Some(length) => at + length,
                None => return Some(position(text, at)),
            },
            [b'"', ..] => at + quoted_length(rest, b'"'),
            [b'\'', ..] => at + quoted_length(rest, b'\''),
            [b'`', ..] => at + 1 + length_until(rest.get(1..)?, b"`"),
            [b'#', ..] => at + raw_length(rest),
            _ => at + 1,
        };
    }
    None
}

/// Number of bytes up to the end of a mark; all bytes if there is no mark.
fn length_until(text: &[u8], mark: &[u8]) -> usize {
    text.windows(mark.len()).position(|window| window == mark).map_or(text.len(), |found| found + mark.len())
}

/// Number of bytes of a block comment, which may contain others; `None` if it does not end.
fn block_length(text: &[u8]) -> Option<usize> {
    let (mut depth, mut at) = (0usize, 0);
    while at + 1 < text.len() {
        match text.get(at..at + 2)? {
            b"/*" => (depth, at) = (depth + 1, at + 2),
            b"*/" => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            return Some(at);
        }
    }
    None
}

/// Number of bytes of a text in quotes; a backslash escapes the next character.
fn quoted_length(text: &[u8], quote: u8) -> usize {
    let mut at = 1;
    while let Some(byte) = text.get(at) {
        match byte {
            b'\\' => at += 2,
            byte if *byte == quote => return at + 1,
            _ => at += 1,
        }
    }
    text.len()
}

/// Number of bytes of a raw text such as `#"..."#`; 1 for any other `#`.
fn raw_length(text: &[u8]) -> usize {
    let hashes = text.iter().take_while(|byte| **byte == b'#').count();
    if text.get(hashes) != Some(&b'"') {
        return 1;
    }
    let end = [b"\"".as_slice(), &text[..hashes]].concat();
    hashes + 1 + length_until(text.get(hashes + 1..).unwrap_or_default(), &end)
}

fn position(text: &str, at: usize) -> Position {
    let before = text.get(..at).unwrap_or_default();
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |line| line.chars().count()) + 1;
    match (u16::try_from(line), u16::try_from(column)) {
        (Ok(line), Ok(column)) => Position::new(line, column),
        _ => Position::NONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_that_does_not_end_is_found() {
        for (text, at) in [
            ("jump(1);\n/* jump(2);\njump(3);", Some((2, 1))),
            ("a();  /* one /* two */ still open", Some((1, 7))),
            ("/* a */ b(); // /* c", None),
            ("x(\"/* no comment\"); y('/'); z(`/* ${1}`);", None),
            ("x(\"\\\"/*\");", None),
            ("x(#\"/* \"#); /* one */", None),
            ("/*/", Some((1, 1))),
            ("let m = #{a: 1};", None),
        ] {
            let expected = at.map(|(line, column)| Position::new(line, column));
            assert_eq!(find_unclosed_comment(text), expected, "{text}");
        }
    }
}
