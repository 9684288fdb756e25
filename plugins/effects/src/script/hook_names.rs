//! The hooks of a script.

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
