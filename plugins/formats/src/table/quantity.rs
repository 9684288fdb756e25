//! What a column of a map's table holds, from its heading.

use mapper_core::ReferenceState;
use mapper_physics::air::GAS_CONSTANT_J_KGK;
use mapper_yaml::units::{Kind, Reference, Unit, header_unit, split_unit, volume_flow_m3_s};

/// Quantities of a table of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Corrected speed; the measured speed in a table of measured points.
    Speed,
    /// Speed over the root of T1.
    ReducedSpeed,
    /// Corrected flow; the measured flow in a table of measured points.
    Flow,
    /// Volume flow at the inlet, at the reference state.
    VolumeFlow,
    /// Flow times the root of T1 over P1.
    ReducedFlow,
    /// Total pressure ratio.
    PressureRatio,
    /// Isentropic efficiency.
    Efficiency,
    /// Measured inlet pressure.
    P1,
    /// Measured outlet pressure.
    P2,
    /// Measured inlet temperature.
    T1,
    /// Measured outlet temperature.
    T2,
}

impl Quantity {
    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Speed => "speed",
            Quantity::ReducedSpeed => "speed over the root of temperature",
            Quantity::Flow => "mass flow",
            Quantity::VolumeFlow => "volume flow",
            Quantity::ReducedFlow => "flow times the root of temperature over pressure",
            Quantity::PressureRatio => "pressure ratio",
            Quantity::Efficiency => "efficiency",
            Quantity::P1 => "P1",
            Quantity::P2 => "P2",
            Quantity::T1 => "T1",
            Quantity::T2 => "T2",
        }
    }

    fn kind(self) -> Kind {
        match self {
            Quantity::Speed | Quantity::ReducedSpeed => Kind::Speed,
            Quantity::Flow | Quantity::VolumeFlow | Quantity::ReducedFlow => Kind::MassFlow,
            Quantity::PressureRatio | Quantity::Efficiency => Kind::Fraction,
            Quantity::P1 | Quantity::P2 => Kind::Pressure,
            Quantity::T1 | Quantity::T2 => Kind::Temperature,
        }
    }
}

/// A column with its unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub(super) index: usize,
    pub(super) quantity: Quantity,
    /// Its heading.
    pub(super) heading: String,
    /// Its unit as written; empty if it names none.
    pub(super) unit: String,
    scale: Scale,
}

/// How a value becomes SI.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scale {
    Unit(&'static Unit),
    Factor(f64),
}

impl Column {
    /// A column without a heading, in SI and rpm.
    pub(super) fn bare(index: usize, quantity: Quantity) -> Column {
        Column { index, quantity, heading: String::new(), unit: String::new(), scale: Scale::Factor(1.0) }
    }

    /// A value in SI and rpm. Volume flows count at the density of the reference state, reduced quantities become corrected ones.
    pub(super) fn inside(&self, value: f64, reference: ReferenceState) -> f64 {
        let value = match self.scale {
            Scale::Unit(unit) => unit.to_inside(value),
            Scale::Factor(factor) => factor * value,
        };
        let (t_ref_k, p_ref_pa) = (reference.t_ref_k, reference.p_ref_pa);
        match self.quantity {
            Quantity::ReducedSpeed => value * t_ref_k.sqrt(),
            Quantity::ReducedFlow => value * p_ref_pa / t_ref_k.sqrt(),
            Quantity::VolumeFlow => value * p_ref_pa / (GAS_CONSTANT_J_KGK * t_ref_k),
            _ => value,
        }
    }

    /// Whether the heading names a unit.
    pub(super) fn has_unit(&self) -> bool {
        !self.unit.is_empty()
    }
}

/// Why a heading is not understood.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum ColumnError {
    #[error("the heading `{heading}` has the unit `{unit}`, which is none of a {kind}; write one of {known}")]
    Unit { heading: String, unit: String, kind: &'static str, known: String },
    #[error("the heading `{heading}` belongs to a turbine map; `mapper` reads compressor maps")]
    Turbine { heading: String },
}

/// The column of a heading; `None` if it holds none of the quantities.
pub(super) fn column(index: usize, heading: &str) -> Result<Option<Column>, ColumnError> {
    let (name, unit) = parts(heading);
    let plain: String =
        name.to_lowercase().chars().filter(|c| c.is_alphanumeric() || "/√η^.".contains(*c)).collect();
    let shown = || heading.chars().take(60).collect::<String>();
    if is_turbine(&plain) {
        return Err(ColumnError::Turbine { heading: shown() });
    }
    let by_unit = unit.as_deref().and_then(quantity_of_unit);
    let Some(quantity) = quantity_of_name(&plain, by_unit).or(by_unit.filter(|_| plain.is_empty())) else {
        return Ok(None);
    };
    let Some(text) = unit.filter(|unit| !says_nothing(unit)) else {
        return Ok(Some(Column { heading: shown(), ..Column::bare(index, quantity) }));
    };
    let scale = scale(quantity, &text).ok_or_else(|| ColumnError::Unit {
        heading: shown(),
        unit: text.chars().take(40).collect(),
        kind: quantity.kind().name(),
        known: match quantity {
            Quantity::VolumeFlow => "m3/s, m3/min, m3/h, l/s, CFM".to_owned(),
            Quantity::ReducedFlow => "kg/s*K^0.5/kPa, kg/s*K^0.5/MPa, kg/s*K^0.5/bar".to_owned(),
            _ => quantity.kind().unit_list(),
        },
    })?;
    Ok(Some(Column { index, quantity, heading: shown(), unit: text, scale }))
}

/// Name and unit of a heading. Brackets that name the kind of a ratio are dropped.
fn parts(heading: &str) -> (String, Option<String>) {
    let heading = heading.trim();
    if !heading.contains(['[', '(']) && quantity_of_unit(heading).is_some() {
        return (String::new(), Some(heading.to_owned()));
    }
    if let Some((name, inside)) = last_bracket(heading)
        && !in_name(name, inside)
    {
        return (name.to_owned(), (!is_kind(inside)).then(|| inside.to_owned()));
    }
    // `MASSc-kg/s`, `Flow kg/s`, `m / kg/h`, `flow_kg_s`.
    let known = |unit: &str| quantity_of_unit(unit).is_some();
    if let (name, Some(unit)) = split_unit(heading)
        && known(&unit)
        && !says_nothing(&unit)
    {
        return (name, Some(unit));
    }
    for separator in [" - ", "-", " ", "/"] {
        for (at, _) in heading.match_indices(separator) {
            let (name, unit) = (heading[..at].trim(), heading[at + separator.len()..].trim());
            if !name.is_empty() && unit.len() > 1 && known(unit) {
                return (name.to_owned(), Some(unit.to_owned()));
            }
        }
    }
    (heading.to_owned(), None)
}

/// What is before the bracket that ends a heading, and what is inside. Name and unit may hold brackets of their own.
fn last_bracket(heading: &str) -> Option<(&str, &str)> {
    let inside = heading.strip_suffix([']', ')'])?;
    let mut depth = 1;
    for (at, c) in inside.char_indices().rev() {
        match c {
            ']' | ')' => depth += 1,
            '[' | '(' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return (at > 0).then(|| (inside[..at].trim(), inside[at + 1..].trim()));
        }
    }
    None
}

/// `sqrt(T)`: the bracket belongs to the name.
fn in_name(name: &str, inside: &str) -> bool {
    let root = name.to_lowercase();
    (root.ends_with("sqrt") || root.ends_with('√')) && inside.len() <= 4
}

/// Total or static ratios, and words that stand in brackets without being a unit.
fn is_kind(inside: &str) -> bool {
    let plain: String = inside.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    matches!(
        plain.as_str(),
        "ts" | "tt"
            | "cc"
            | "ss"
            | "corr"
            | "corrected"
            | "red"
            | "reduced"
            | "is"
            | "isentropic"
            | "total"
            | "korr"
            | "t"
            | "s"
    ) || says_nothing(inside)
}

fn says_nothing(unit: &str) -> bool {
    matches!(
        unit.to_lowercase().as_str(),
        "" | "-" | "--" | "1" | "ratio" | "fraction" | "frac" | "dimensionless" | "dec" | "nd"
    )
}

fn is_turbine(plain: &str) -> bool {
    plain.contains("expansion")
        || (plain.contains("sqrt") || plain.contains('√'))
            && ["t3", "t4", "p3", "tt3", "t03"].iter().any(|inlet| plain.contains(inlet))
}

/// What a unit measures.
fn quantity_of_unit(unit: &str) -> Option<Quantity> {
    let lower = unit.trim().to_lowercase();
    if volume_flow_m3_s(unit).is_some() {
        return Some(Quantity::VolumeFlow);
    }
    if lower == "%" {
        return Some(Quantity::Efficiency);
    }
    if is_root(&lower) {
        return Some(if lower.contains("kg") || lower.contains("lb") {
            Quantity::ReducedFlow
        } else {
            Quantity::ReducedSpeed
        });
    }
    match header_unit(unit)?.kind {
        Kind::Speed => Some(Quantity::Speed),
        Kind::MassFlow => Some(Quantity::Flow),
        _ => None,
    }
}

fn is_root(lower: &str) -> bool {
    ["k^0.5", "k^.5", "k^1/2", "sqrt(k", "sqrtk", "√k", "k0.5", "k**0.5"]
        .iter()
        .any(|root| lower.contains(root))
}

/// What a name means: lower case, letters, digits, `/`, `√` and `η` alone. The unit decides between volume and mass.
fn quantity_of_name(plain: &str, by_unit: Option<Quantity>) -> Option<Quantity> {
    let has = |words: &[&str]| words.iter().any(|word| plain.contains(word));
    let is = |words: &[&str]| words.contains(&plain);
    let root = has(&["sqrt", "√", "^0.5"]);
    if root && plain.starts_with('n') {
        return Some(Quantity::ReducedSpeed);
    }
    if root && has(&["/p"]) || by_unit == Some(Quantity::ReducedFlow) {
        return Some(Quantity::ReducedFlow);
    }
    if is(&[
        "pr", "prc", "prtt", "prts", "pi", "pic", "pitt", "pits", "pitt", "p2/p1", "p02/p01", "pt2/pt1",
        "prcomp", "ratio", "picomp", "pik", "prss",
    ]) || has(&[
        "pressureratio",
        "pressratio",
        "druckverh",
        "rapportdepression",
        "tauxdecompression",
        "relaciondepresi",
        "relacióndepresi",
        "rapportodipress",
        "rapportodicompress",
        "compressionratio",
    ]) {
        return Some(Quantity::PressureRatio);
    }
    if plain.starts_with("eta")
        || plain.starts_with('η')
        || plain.starts_with("eff")
        || has(&[
            "efficiency",
            "wirkungsgrad",
            "rendement",
            "rendimiento",
            "rendimento",
            "eficiencia",
            "efficienza",
        ])
    {
        return Some(Quantity::Efficiency);
    }
    let flow = match by_unit {
        Some(Quantity::VolumeFlow) => Quantity::VolumeFlow,
        _ => Quantity::Flow,
    };
    if has(&[
        "volumeflow",
        "volumetric",
        "volumenstrom",
        "volflow",
        "débitvolum",
        "debitvolum",
        "caudalvolum",
        "portatavolum",
    ]) || is(&["v", "vred", "vdot", "vcorr", "vkorr", "q"]) && by_unit != Some(Quantity::Flow)
    {
        return Some(Quantity::VolumeFlow);
    }
    if has(&[
        "flow",
        "massc",
        "mdot",
        "massenstrom",
        "durchsatz",
        "débit",
        "debit",
        "caudal",
        "portata",
        "massrate",
        "wcorr",
        "wccorr",
        "wckorr",
    ]) || is(&[
        "m", "m1", "mc", "w", "wc", "mred", "mcorr", "mkorr", "mcomp", "mair", "mass", "mluft", "w1",
        "mccorr", "wa", "ma",
    ]) {
        return Some(flow);
    }
    if has(&["speed", "drehzahl", "vitesse", "régime", "regime", "velocidad", "giri", "rpm", "rotation"])
        || is(&[
            "n", "nc", "ncorr", "nccorr", "nkorr", "nred", "natl", "ntc", "nturbo", "nt", "ntl", "n1",
            "nlader", "nc/",
        ])
        || plain.is_empty() && by_unit == Some(Quantity::Speed)
    {
        return Some(Quantity::Speed);
    }
    for (quantity, stem) in
        [(Quantity::P1, "p1"), (Quantity::P2, "p2"), (Quantity::T1, "t1"), (Quantity::T2, "t2")]
    {
        let rest = plain
            .strip_prefix(stem)
            .or_else(|| plain.strip_prefix(&format!("{}0{}", &stem[..1], &stem[1..])));
        if rest.is_some_and(|rest| matches!(rest, "" | "t" | "tot" | "total" | "ges" | "c" | "abs" | "k")) {
            return Some(quantity);
        }
    }
    None
}

fn scale(quantity: Quantity, unit: &str) -> Option<Scale> {
    let lower = unit.trim().to_lowercase();
    match quantity {
        Quantity::VolumeFlow => Some(Scale::Factor(volume_flow_m3_s(unit)??)),
        Quantity::ReducedSpeed if is_root(&lower) => {
            let speed = lower.split(['/', '*', '-']).next()?;
            Some(Scale::Factor(unit_of(Kind::Speed, speed)?.to_inside(1.0)))
        }
        Quantity::ReducedFlow => {
            // `kg/s*K^0.5/kPa`, `kg-sqrt(K)/s-kPa`, `kg*sqrt(K)/(s*kPa)`: the mass is first, the pressure last.
            let mass = unit.split(['*', '-', ' ']).next()?;
            let mass = if mass.contains('/') { mass.to_owned() } else { format!("{mass}/s") };
            let pressure = unit.trim_end_matches([')', ' ']).rsplit(['/', '*', '-', ' ', '(']).next()?;
            let kg_s = unit_of(Kind::MassFlow, &mass)?.to_inside(1.0);
            Some(Scale::Factor(kg_s / unit_of(Kind::Pressure, pressure)?.to_inside(1.0)))
        }
        _ => unit_of(quantity.kind(), unit).map(Scale::Unit),
    }
}

/// The unit of a kind under any spelling that headings use. A map has absolute pressures.
fn unit_of(kind: Kind, text: &str) -> Option<&'static Unit> {
    let named =
        || header_unit(text).filter(|found| found.kind == kind && found.reference != Reference::Gauge);
    kind.unit(text).or_else(|| Some(named()?.unit))
}
