//! The rhai engine of a script: its restrictions and its resource limits.

use rhai::packages::{
    ArithmeticPackage, BasicArrayPackage, BasicFnPackage, BasicIteratorPackage, BasicMapPackage,
    BasicMathPackage, BasicStringPackage, LogicPackage, MoreStringPackage, Package,
};
use rhai::{Dynamic, Engine, EvalAltResult, Position};
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

/// Reason for which a script was ended from outside.
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
