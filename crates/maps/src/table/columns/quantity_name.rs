//! What the name of a column means.

use crate::table::columns::quantity::Quantity;

/// Whether a name belongs to a turbine.
pub(crate) fn is_turbine(plain: &str) -> bool {
    plain.contains("expansion")
        || matches!(plain, "mfp" | "prt" | "wt" | "etat")
        || (plain.contains("sqrt") || plain.contains('√'))
            && ["t3", "t4", "p3", "tt3", "t03"].iter().any(|inlet| plain.contains(inlet))
}

/// Quantities that only a turbine map has, or that it names in its own way.
pub(crate) fn quantity_of_turbine(plain: &str, by_unit: Option<Quantity>) -> Option<Quantity> {
    let has = |words: &[&str]| words.iter().any(|word| plain.contains(word));
    let is = |words: &[&str]| words.contains(&plain);
    if has(&["vane", "vgt", "vtg", "rack", "nozzleopening", "leitschaufel", "leitapparat", "wastegate"]) {
        return Some(Quantity::Vane);
    }
    if has(&["expansion", "détente", "detente", "espansione"])
        || is(&["er", "prt", "pit", "p3/p4", "p03/p4", "pt3/p4", "pt3/ps4", "p3t/p4s", "prts"])
    {
        return Some(Quantity::PressureRatio);
    }
    if is(&["sp", "speedparameter", "speedparam", "nred", "reducedspeed"]) {
        let corrected = by_unit == Some(Quantity::Speed);
        return Some(if corrected { Quantity::Speed } else { Quantity::ReducedSpeed });
    }
    if is(&["mfp", "massflowparameter", "flowparameter", "massparameter", "phi"]) {
        return Some(Quantity::ReducedFlow);
    }
    if is(&["nt"]) {
        return Some(by_unit.unwrap_or(Quantity::Speed));
    }
    is(&["wt", "mt"]).then_some(by_unit.unwrap_or(Quantity::Flow))
}

/// What a name means: lower case, letters, digits, `/`, `√` and `η` alone. The unit decides between volume and mass.
pub(crate) fn quantity_of_name(plain: &str, by_unit: Option<Quantity>) -> Option<Quantity> {
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
        "m",
        "m1",
        "mc",
        "w",
        "wc",
        "mred",
        "mcorr",
        "mkorr",
        "mcomp",
        "mair",
        "mass",
        "mluft",
        "w1",
        "mccorr",
        "wa",
        "ma",
        "mv",
        "ml",
        "mverd",
        "mverdichter",
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
    if has(&["baro", "ambientpress", "atmospher", "luftdruck", "umgebungsdruck"])
        || is(&["pamb", "patm", "pumg"])
    {
        return Some(Quantity::Ambient);
    }
    if has(&["humid", "feuchte", "humedad", "umidit"]) || is(&["rh", "relhum"]) {
        return Some(Quantity::Humidity);
    }
    let is_wall = has(&["housing", "gehäuse", "gehaeuse", "casing", "carter", "carcasa", "carcassa"]);
    if is(&["tc", "tch", "thc"]) || is_wall && !has(&["turb", "bearing", "lager", "palier"]) {
        return Some(Quantity::Tc);
    }
    for (quantity, stem) in
        [(Quantity::P1, "p1"), (Quantity::P2, "p2"), (Quantity::T1, "t1"), (Quantity::T2, "t2")]
    {
        let rest = plain
            .strip_prefix(stem)
            .or_else(|| plain.strip_prefix(&format!("{}0{}", &stem[..1], &stem[1..])));
        if rest.is_some_and(|rest| {
            matches!(
                rest,
                "" | "t"
                    | "tot"
                    | "total"
                    | "ges"
                    | "c"
                    | "abs"
                    | "k"
                    | "s"
                    | "stat"
                    | "static"
                    | "rel"
                    | "gauge"
            )
        }) {
            return Some(quantity);
        }
    }
    None
}
