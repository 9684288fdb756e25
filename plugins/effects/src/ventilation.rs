//! Air moves in the cell.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "ventilation",
        "air moves around the housings: convection to the cell is stronger or weaker",
        "Q_ext = A_ext (s 1.25 |T - T_amb|^(1/3) (T - T_amb) + eps sigma (T^4 - T_amb^4)), both housings",
        "Burke et al., Appendix A, external convection",
        Submodel::TurbineHousing,
        vec![parameter("ventilation", "1", [0.1, 5.0], 1.0, 0.6)],
        |values, rig| rig.model.params.external_convection_ratio *= values[0],
    )
}
