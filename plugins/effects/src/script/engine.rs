//! The script engine: its restrictions, its limits, and one instance per thread.

use super::header::Mistake;
use mapper_core::Channel;
use mapper_physics::machine::hooks::Site;
use mapper_physics::rig::effect::{EffectError, NamedValues};
use rhai::packages::{ArithmeticPackage, BasicMathPackage, LogicPackage, Package};
use rhai::{AST, CallFnOptions, Dynamic, Engine, FuncArgs, ParseError, Position, Scope};
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

/// Functions a script may define, in addition to `reading_CHANNEL(at, p, value)`, with the number of their arguments:
/// `(at, p, value)` returns the value for the model, `(at, p)` a term to add.
pub const HOOK_NAMES: [(&str, usize); 11] = [
    ("flow_kg_s", 3),
    ("efficiency", 3),
    ("h_w_m2k", 3),
    ("gas_before_k", 3),
    ("gas_after_k", 3),
    ("gas_outlet_k", 3),
    ("heat_to_compressor_w", 2),
    ("heat_to_inner_w", 2),
    ("heat_to_turbine_w", 2),
    ("shaft_torque_nm", 2),
    ("flow_to_outlet_kg_s", 2),
];

/// Maximum operations of one call: a hook is called some million times in a run.
const MAX_OPERATIONS: u64 = 10_000;
const MAX_CALL_DEPTH: usize = 8;
const MAX_EXPRESSION_DEPTH: usize = 64;
const MAX_STRING_CHARS: usize = 256;
const MAX_VARIABLES: usize = 64;
const MAX_FUNCTIONS: usize = 64;
const MAX_CACHED_ENGINES: usize = 32;

/// The machine's values for a script: `at.tc_k` and so on.
#[derive(Debug, Clone, Copy)]
pub(super) struct At {
    values: [f64; FIELDS.len()],
}

/// Reads one of the machine's values.
type Field = fn(&Site<'_>) -> f64;

/// The values of a script by name. Values from later in the gas path than a hook are NaN there.
const FIELDS: [(&str, Field); 23] = [
    ("t_s", |site| site.t_s),
    ("speed_rad_s", |site| site.state.shaft_speed_rad_s),
    ("speed_rpm", |site| site.state.shaft_speed_rpm()),
    ("p1_pa", |site| site.boundary.p1_pa),
    ("p2_pa", |site| site.state.p2_pa),
    ("p3_pa", |site| site.boundary.p3_pa),
    ("p4_pa", |site| site.boundary.p4_pa),
    ("t1_k", |site| site.boundary.t1_k),
    ("t1_prime_k", |site| site.t1_prime_k),
    ("t2_prime_k", |site| site.t2_prime_k),
    ("t2_k", |site| site.t2_k),
    ("t3_k", |site| site.boundary.t3_k),
    ("tc_k", |site| site.state.tc_k),
    ("tt_k", |site| site.state.tt_k),
    ("wall_k", |site| site.wall_k),
    ("bearing_k", |site| site.bearing_k),
    ("oil_k", |site| site.boundary.oil_temperature_k),
    ("ambient_k", |site| site.boundary.ambient_temperature_k),
    ("valve_opening", |site| site.boundary.valve_opening_ratio),
    ("pressure_ratio", |site| site.pressure_ratio),
    ("flow_kg_s", |site| site.flow_kg_s),
    ("efficiency", |site| site.efficiency),
    ("h_w_m2k", |site| site.h_w_m2k),
];

impl At {
    pub(super) fn new(site: &Site<'_>) -> Self {
        At { values: FIELDS.map(|(_, read)| read(site)) }
    }
}

/// The values of a script's parameters, as `p.G` reads them: in the order of the program's parameters.
#[derive(Debug, Clone)]
pub(super) struct Numbers(Arc<[f64]>);

/// A compiled script with a unique number.
pub(super) struct Program {
    id: u64,
    text: String,
    parameters: Vec<String>,
    defined: BTreeSet<String>,
}

/// Equal for equal scripts.
impl std::fmt::Debug for Program {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

struct Compiled {
    engine: Engine,
    ast: AST,
}

thread_local! {
    /// Each thread has its own rhai engines, so that scripts run on all cores without waiting for each other.
    static COMPILED: RefCell<HashMap<u64, Rc<Compiled>>> = RefCell::new(HashMap::new());
}

impl Program {
    /// Compiles a script to check it.
    /// `needs_hook`: whether it must define at least one hook.
    pub(super) fn new(text: &str, parameters: Vec<String>, needs_hook: bool) -> Result<Self, Mistake> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let Compiled { ast, .. } = compile(text, &parameters)?;
        let mut defined = BTreeSet::new();
        for function in ast.iter_functions() {
            let name = function.name;
            let reading = name.strip_prefix("reading_");
            if let Some(Err(unknown)) = reading.map(str::parse::<Channel>) {
                return Err((None, format!("function {name}: {unknown}")));
            }
            let hook = HOOK_NAMES.iter().find(|(hook, _)| *hook == name);
            let Some(arguments) = reading.map(|_| 3).or(hook.map(|(_, arguments)| *arguments)) else {
                continue;
            };
            if function.params.len() != arguments {
                let form = if arguments == 3 { "(at, p, value)" } else { "(at, p)" };
                return Err((
                    None,
                    format!("`{name}` takes {} arguments; write {name}{form}", function.params.len()),
                ));
            }
            defined.insert(name.to_owned());
        }
        if defined.is_empty() && needs_hook {
            let names: Vec<&str> = HOOK_NAMES.iter().map(|(name, _)| *name).collect();
            let message = format!(
                "it defines no hook: define one of {}, or reading_T2 (or that of another channel)",
                names.join(", ")
            );
            return Err((None, message));
        }
        let id = NEXT.fetch_add(1, Ordering::Relaxed);
        Ok(Program { id, text: text.to_owned(), parameters, defined })
    }

    /// The value of each parameter of the script.
    pub(super) fn numbers(&self, values: &NamedValues<'_>) -> Result<Numbers, EffectError> {
        Ok(Numbers(self.parameters.iter().map(|name| values.get(name)).collect::<Result<_, _>>()?))
    }

    pub(super) fn has_no_hook(&self) -> bool {
        self.defined.is_empty()
    }

    pub(super) fn defines(&self, name: &str) -> bool {
        self.defined.contains(name)
    }

    /// Calls a function. An error is stored in `fault`, and the result is NaN.
    pub(super) fn call(&self, name: &str, arguments: impl FuncArgs, fault: &OnceLock<String>) -> f64 {
        match self.try_call(name, arguments) {
            Ok(value) => value,
            Err(message) => {
                fault.get_or_init(|| message);
                f64::NAN
            }
        }
    }

    fn try_call(&self, name: &str, arguments: impl FuncArgs) -> Result<f64, String> {
        let compiled = self.on_this_thread()?;
        let options = CallFnOptions::new().eval_ast(false);
        let result: Dynamic = compiled
            .engine
            .call_fn_with_options(options, &mut Scope::new(), &compiled.ast, name, arguments)
            .map_err(|error| error.to_string())?;
        result
            .as_float()
            .or_else(|_| result.as_int().map(|value| value as f64))
            .map_err(|kind| format!("`{name}` gave a value of type {kind}; it must give a number"))
    }

    fn on_this_thread(&self) -> Result<Rc<Compiled>, String> {
        COMPILED.with_borrow_mut(|kept| {
            if let Some(compiled) = kept.get(&self.id) {
                return Ok(compiled.clone());
            }
            if kept.len() >= MAX_CACHED_ENGINES {
                kept.clear();
            }
            let compiled = Rc::new(compile(&self.text, &self.parameters).map_err(|(_, message)| message)?);
            kept.insert(self.id, compiled.clone());
            Ok(compiled)
        })
    }
}

fn compile(text: &str, parameters: &[String]) -> Result<Compiled, Mistake> {
    let engine = engine(parameters);
    let of_parse = |error: ParseError| (line_of(error.1), error.0.to_string());
    let ast = engine.compile(text).map_err(of_parse)?;
    Ok(Compiled { engine, ast })
}

fn line_of(position: Position) -> Option<usize> {
    position.line()
}

fn engine(parameters: &[String]) -> Engine {
    let mut engine = Engine::new_raw();
    ArithmeticPackage::new().register_into_engine(&mut engine);
    LogicPackage::new().register_into_engine(&mut engine);
    BasicMathPackage::new().register_into_engine(&mut engine);
    // Numbers only: without arrays and maps, memory cannot grow.
    for symbol in ["eval", "this", "[", "#{"] {
        engine.disable_symbol(symbol);
    }
    engine
        .set_max_operations(MAX_OPERATIONS)
        .set_max_call_levels(MAX_CALL_DEPTH)
        .set_max_expr_depths(MAX_EXPRESSION_DEPTH, MAX_EXPRESSION_DEPTH)
        .set_max_string_size(MAX_STRING_CHARS)
        .set_max_variables(MAX_VARIABLES)
        .set_max_functions(MAX_FUNCTIONS)
        .set_strict_variables(true);
    engine.register_type_with_name::<At>("machine").register_type_with_name::<Numbers>("parameters");
    for (index, (name, _)) in FIELDS.iter().enumerate() {
        engine.register_get(*name, move |at: &mut At| at.values[index]);
    }
    for (index, name) in parameters.iter().enumerate() {
        engine.register_get(name, move |numbers: &mut Numbers| {
            numbers.0.get(index).copied().unwrap_or(f64::NAN)
        });
    }
    engine
}
