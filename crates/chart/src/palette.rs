//! Colours that are distinguishable with any colour vision; ordered ones also on a black-and-white printer.

/// An sRGB colour, 8 bits per channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

impl Colour {
    /// `#rrggbb`.
    pub fn hex(self) -> String {
        format!("#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }

    /// Mixes with white: `share` 0 gives white, 1 the colour itself (clamped to 0..1).
    pub fn tint(self, share: f64) -> Colour {
        blend(WHITE, self, share)
    }
}

/// Black for text and frames, slightly softened.
pub const INK: Colour = Colour(34, 34, 34);
/// White.
pub const WHITE: Colour = Colour(255, 255, 255);
/// Grey for the background.
pub const GREY: Colour = Colour(119, 119, 119);
/// Light grey for grid lines.
pub const LIGHT_GREY: Colour = Colour(225, 225, 225);
/// Okabe-Ito blue.
pub const BLUE: Colour = Colour(0, 114, 178);
/// Okabe-Ito vermillion.
pub const VERMILLION: Colour = Colour(213, 94, 0);
/// Okabe-Ito bluish green.
pub const GREEN: Colour = Colour(0, 158, 115);
/// Okabe-Ito reddish purple.
pub const PURPLE: Colour = Colour(204, 121, 167);
/// Okabe-Ito orange.
pub const ORANGE: Colour = Colour(230, 159, 0);
/// Okabe-Ito sky blue.
pub const SKY: Colour = Colour(86, 180, 233);

/// Colours for unordered series, in the order they should be used.
///
/// Source: M. Okabe, K. Ito, "Color Universal Design", 2008; without its yellow, which is not legible on white.
pub const CATEGORICAL: [Colour; 7] = [BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, INK];

/// Colour of series `index` from [`CATEGORICAL`], cyclically.
pub fn categorical(index: usize) -> Colour {
    CATEGORICAL[index % CATEGORICAL.len()]
}

/// Colours for ordered series (speed lines): dark violet (0) to green (1), lightness rising monotonically.
///
/// Viridis (S. van der Walt, N. Smith, 2015) without its yellow end, which is not legible on white. `fraction` is
/// clamped to 0..1; NaN counts as 0.
pub fn sequential(fraction: f64) -> Colour {
    const STOPS: [Colour; 7] = [
        Colour(68, 1, 84),
        Colour(70, 50, 127),
        Colour(54, 92, 141),
        Colour(39, 127, 142),
        Colour(31, 161, 135),
        Colour(74, 193, 109),
        Colour(122, 209, 81),
    ];
    // The last stop is too pale: use five sixths of the scale.
    let at = unit(fraction) * 5.0;
    let lower = (at.floor() as usize).min(STOPS.len() - 2);
    blend(STOPS[lower], STOPS[lower + 1], at - lower as f64)
}

fn unit(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

fn blend(from: Colour, to: Colour, share: f64) -> Colour {
    let share = unit(share);
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * share).round() as u8;
    Colour(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance, ITU-R BT.709 coefficients on linearised sRGB.
    fn luminance(colour: Colour) -> f64 {
        let linear = |v: u8| {
            let v = f64::from(v) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(colour.0) + 0.7152 * linear(colour.1) + 0.0722 * linear(colour.2)
    }

    #[test]
    fn ordered_colours_get_steadily_lighter() {
        let lightness: Vec<f64> = (0..=20).map(|i| luminance(sequential(f64::from(i) / 20.0))).collect();
        assert!(lightness.windows(2).all(|pair| pair[1] > pair[0]), "{lightness:?}");
    }

    #[test]
    fn bad_fractions_give_a_colour() {
        assert_eq!(sequential(f64::NAN), sequential(0.0));
        assert_eq!(sequential(9.0), sequential(1.0));
        assert_eq!(BLUE.tint(0.0), WHITE);
        assert_eq!(BLUE.tint(1.0).hex(), "#0072b2");
    }
}
