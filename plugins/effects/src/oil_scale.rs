//! Oil takes more or less heat from the bearing housing.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "oil_scale",
        "the oil takes more or less heat from the bearing housing",
        "G_oil = s G_oil,nominal",
        "flow and viscosity of the oil: Burke et al., Appendix A, bearing housing",
        Submodel::TurbineHousing,
        vec![parameter("oil_scale", "1", [0.1, 5.0], 1.0, 0.4)],
        |values, rig| rig.model.params.bearing.oil_conductance_w_k *= values[0],
    )
}
