//! Speeds at which a shaft must not stay: critical speeds and resonances of blades. A jump crosses them.

use serde::{Deserialize, Serialize};

/// Maximum number of ranges. Bound: critical speeds of a shaft and first modes of its blades are fewer.
const MAX_RANGES: usize = 8;
/// Resolution of speeds in messages, rpm. Bound: 0.01 krpm; no rig holds a speed more closely.
const SHOWN_RPM: f64 = 10.0;

/// Band within which a controlled speed counts as reached, ratio. Bound: a third of the smallest change of speed that is a jump.
pub(crate) const BAND_RATIO: f64 = 0.003;

/// A range of shaft speeds that a jump may cross and no step may hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AvoidedRange {
    /// Lowest speed inside, rpm.
    pub from_rpm: f64,
    /// Highest speed inside, rpm.
    pub to_rpm: f64,
    /// Longest time inside in one step, s, > 0.
    pub longest_s: f64,
}

impl AvoidedRange {
    /// Default of the longest time inside, s. Bound: a thousand crossings at 100 krpm, excited twice in a revolution, are the 1e7 cycles of
    /// a fatigue limit.
    pub const LONGEST_S: f64 = 3.0;

    /// The speeds that no step may hold, rpm: the range, and the band within which a controlled speed counts as reached.
    fn refused_rpm(&self) -> (f64, f64) {
        (self.from_rpm * (1.0 - BAND_RATIO), self.to_rpm * (1.0 + BAND_RATIO))
    }

    fn refuses(&self, target_rpm: f64) -> bool {
        let (low_rpm, high_rpm) = self.refused_rpm();
        target_rpm > low_rpm && target_rpm < high_rpm
    }

    /// The nearest speeds below and above that a step may hold, as messages show them, rpm.
    fn nearest_rpm(&self) -> (f64, f64) {
        let (low_rpm, high_rpm) = self.refused_rpm();
        let below = ((low_rpm - 1.0) / SHOWN_RPM).floor();
        (SHOWN_RPM * below, SHOWN_RPM * ((high_rpm + 1.0) / SHOWN_RPM).ceil())
    }

    /// Time inside while the speed changes from one to the other within `duration_s`, s.
    fn inside_s(&self, from_rpm: f64, to_rpm: f64, duration_s: f64) -> f64 {
        let (low_rpm, high_rpm) = (from_rpm.min(to_rpm), from_rpm.max(to_rpm));
        let inside_rpm = high_rpm.min(self.to_rpm) - low_rpm.max(self.from_rpm);
        match high_rpm > low_rpm {
            true => duration_s * inside_rpm.max(0.0) / (high_rpm - low_rpm),
            false if inside_rpm >= 0.0 => duration_s,
            false => 0.0,
        }
    }
}

/// The speeds to avoid, at most eight ranges that do not overlap.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(from = "Vec<AvoidedRange>", into = "Vec<AvoidedRange>")]
pub struct AvoidedSpeeds([Option<AvoidedRange>; MAX_RANGES]);

impl From<Vec<AvoidedRange>> for AvoidedSpeeds {
    /// Further ranges are left out: a checked campaign has none.
    fn from(ranges: Vec<AvoidedRange>) -> Self {
        let mut all = AvoidedSpeeds::default();
        all.0.iter_mut().zip(ranges).for_each(|(place, range)| *place = Some(range));
        all
    }
}

impl From<AvoidedSpeeds> for Vec<AvoidedRange> {
    fn from(avoided: AvoidedSpeeds) -> Self {
        avoided.iter().collect()
    }
}

impl AvoidedSpeeds {
    /// No ranges.
    pub const NONE: AvoidedSpeeds = AvoidedSpeeds([None; MAX_RANGES]);

    /// The ranges.
    pub fn iter(&self) -> impl Iterator<Item = AvoidedRange> {
        self.0.into_iter().flatten()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }

    /// The range that forbids a step at this speed.
    pub fn refusing(&self, target_rpm: f64) -> Option<AvoidedRange> {
        self.iter().find(|range| range.refuses(target_rpm))
    }

    /// The range that forbids a step at this speed, and the nearest speeds on both sides that are allowed, rpm, at most `limit_rpm`.
    pub fn at(&self, target_rpm: f64, limit_rpm: f64) -> Option<(AvoidedRange, Vec<f64>)> {
        let refused = self.refusing(target_rpm)?;
        // The nearest speed beyond one range may lie in the next.
        let nearest = |side: fn((f64, f64)) -> f64| {
            let mut rpm = side(refused.nearest_rpm());
            while let Some(next) = self.refusing(rpm) {
                rpm = side(next.nearest_rpm());
            }
            rpm
        };
        let mut nearest_rpm = vec![nearest(|sides| sides.0), nearest(|sides| sides.1)];
        nearest_rpm.retain(|rpm| *rpm > 0.0 && *rpm <= limit_rpm);
        Some((refused, nearest_rpm))
    }

    /// Whether a jump between these speeds crosses a range.
    pub fn is_crossed(&self, from_rpm: f64, to_rpm: f64) -> bool {
        let (low_rpm, high_rpm) = (from_rpm.min(to_rpm), from_rpm.max(to_rpm));
        self.iter().any(|range| low_rpm < range.to_rpm && high_rpm > range.from_rpm)
    }
}

/// The time that a shaft spends inside a range.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AvoidedCrossing {
    /// The range.
    #[serde(flatten)]
    pub range: AvoidedRange,
    /// Time inside, s.
    pub inside_s: f64,
}

impl AvoidedCrossing {
    /// The time inside, relative to the longest one.
    pub fn ratio(&self) -> f64 {
        self.inside_s / self.range.longest_s
    }
}

/// Adds up the time inside each range.
#[derive(Debug, Clone, Copy, Default)]
pub struct AvoidedTime {
    last: Option<(f64, f64)>,
    inside_s: [f64; MAX_RANGES],
}

impl AvoidedTime {
    /// Adds readings, s and rpm; absent ones are not finite.
    pub fn add_all(&mut self, avoid: &AvoidedSpeeds, (t_s, speed_rpm): (&[f64], &[f64])) {
        for (t_s, rpm) in t_s.iter().zip(speed_rpm).filter(|(_, rpm)| rpm.is_finite()) {
            self.add(avoid, *t_s, *rpm);
        }
    }

    /// Adds the speed at a time, s, rpm. Times increase.
    pub fn add(&mut self, avoid: &AvoidedSpeeds, t_s: f64, speed_rpm: f64) {
        if let Some((last_s, last_rpm)) = self.last.replace((t_s, speed_rpm)) {
            for (inside_s, range) in self.inside_s.iter_mut().zip(avoid.iter()) {
                *inside_s += range.inside_s(last_rpm, speed_rpm, t_s - last_s);
            }
        }
    }

    /// The range whose longest time was used up most, if the shaft was inside any.
    pub fn slowest(&self, avoid: &AvoidedSpeeds) -> Option<AvoidedCrossing> {
        let crossings =
            avoid.iter().zip(self.inside_s).map(|(range, inside_s)| AvoidedCrossing { range, inside_s });
        crossings.filter(|crossing| crossing.inside_s > 0.0).max_by(|a, b| a.ratio().total_cmp(&b.ratio()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(from_rpm: f64, to_rpm: f64) -> AvoidedRange {
        AvoidedRange { from_rpm, to_rpm, longest_s: 2.0 }
    }

    #[test]
    fn a_constant_rate_spends_its_share_inside_and_a_rest_inside_counts_fully() {
        let avoid = AvoidedSpeeds::from(vec![range(88e3, 92e3), range(50e3, 51e3)]);
        let mut time = AvoidedTime::default();
        // 40 krpm in 10 s: 4 krpm of them inside.
        time.add(&avoid, 0.0, 60e3);
        time.add(&avoid, 10.0, 100e3);
        assert!((time.slowest(&avoid).unwrap().inside_s - 1.0).abs() < 1e-12);
        time.add(&avoid, 11.0, 90e3);
        time.add(&avoid, 14.0, 90e3);
        // 8 of 10 krpm are outside on the way back: 2 krpm of 10 in one second, and three seconds at rest.
        let slowest = time.slowest(&avoid).unwrap();
        assert!((slowest.inside_s - 4.2).abs() < 1e-12 && slowest.range == range(88e3, 92e3));
        assert_eq!(AvoidedTime::default().slowest(&avoid), None);
    }

    #[test]
    fn the_nearest_allowed_speeds_lie_beyond_all_ranges_and_below_the_limit() {
        let both = AvoidedSpeeds::from(vec![range(88e3, 92e3), range(92.1e3, 95e3)]);
        let (_, nearest) = both.at(90e3, 120e3).unwrap();
        assert_eq!(nearest.len(), 2);
        assert!(nearest[0] < 88e3 && nearest[1] > 95e3);
        for rpm in nearest {
            assert_eq!(both.refusing(rpm), None, "{rpm}");
        }
        let (_, below) = AvoidedSpeeds::from(vec![range(100e3, 120e3)]).at(110e3, 120e3).unwrap();
        assert_eq!(below.len(), 1, "nothing above the limit of speed");
    }

    #[test]
    fn ranges_are_stored_as_a_list() {
        let avoid = AvoidedSpeeds::from(vec![range(88e3, 92e3)]);
        let text = serde_json::to_string(&avoid).unwrap();
        assert!(text.starts_with('['), "{text}");
        assert_eq!(serde_json::from_str::<AvoidedSpeeds>(&text).unwrap(), avoid);
    }
}
