//! Power that the bearings take from the shaft: c omega^2, viscous friction of journal bearings (Petroff).

use crate::machine::state::rad_s_of_rpm;

/// Friction power, W, from the friction coefficient c in W s^2/rad^2 and the shaft speed in rad/s.
pub fn friction_power_w(bearing_friction_w_s2: f64, shaft_speed_rad_s: f64) -> f64 {
    bearing_friction_w_s2 * shaft_speed_rad_s * shaft_speed_rad_s
}

/// A friction coefficient in W s^2/rad^2 as text: the power at 150 krpm to two digits, e.g. "370 W at 150 krpm".
pub fn at_150_krpm(bearing_friction_w_s2: f64) -> String {
    let power_w = friction_power_w(bearing_friction_w_s2, rad_s_of_rpm(150e3));
    if power_w == 0.0 || !power_w.is_finite() {
        return format!("{power_w} W at 150 krpm");
    }
    let second_digit = power_w.abs().log10().floor() as i32 - 1;
    let step_w = 10f64.powi(second_digit);
    let decimals = (-second_digit).max(0) as usize;
    format!("{:.decimals$} W at 150 krpm", (power_w / step_w).round() * step_w)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 150 krpm are 15708 rad/s, their square 2.467e8, times 1.49e-6 368 W.
    #[test]
    fn power_by_hand() {
        let power_w = friction_power_w(1.49e-6, rad_s_of_rpm(150e3));
        // Four figures by hand.
        assert!((power_w - 367.6).abs() < 0.1, "{power_w}");
    }

    #[test]
    fn two_figures() {
        assert_eq!(at_150_krpm(1.49e-6), "370 W at 150 krpm");
        assert_eq!(at_150_krpm(1.5e-7), "37 W at 150 krpm");
        assert_eq!(at_150_krpm(-2.9e-8), "-7.2 W at 150 krpm");
        assert_eq!(at_150_krpm(0.0), "0 W at 150 krpm");
    }
}
