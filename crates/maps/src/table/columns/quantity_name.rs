//! Recognises the quantity of a column by its name.

use crate::table::columns::quantity::Quantity;

/// Whether a name belongs to a turbine.
pub(crate) fn is_turbine(plain: &str) -> bool {
    plain.contains("expansion")
        || matches!(plain, "mfp" | "prt" | "etat")
        || (plain.contains("sqrt") || plain.contains('√'))
            && ["t3", "t4", "p3", "tt3", "t03"].iter().any(|inlet| plain.contains(inlet))
}

/// The quantity of a name that only turbine maps use.
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
    is(&["wt", "mt"])
        .then_some(by_unit.filter(|unit| *unit != Quantity::Flow).unwrap_or(Quantity::TurbineFlow))
}

/// A pressure or temperature whose place is in words: `Compressor inlet pressure`, `Druck vor Turbine`; without a machine the compressor's.
fn quantity_of_place(plain: &str) -> Option<Quantity> {
    let is_turbine = ["turb", "exhaust", "abgas"].iter().any(|word| plain.contains(word));
    let machines = [
        "compresseur",
        "compressore",
        "compressor",
        "compresor",
        "kompressor",
        "verdichter",
        "compr",
        "comp",
        "turbine",
        "turbina",
    ];
    let place = machines.iter().fold(plain.to_owned(), |rest, machine| rest.replace(machine, ""));
    let has = |words: &[&str]| words.iter().any(|word| place.contains(word));
    if has(&["cooler", "kühler", "manifold", "cylinder", "engine", "room", "egr"]) {
        return None;
    }
    const OUTLETS: [&str; 12] = [
        "out",
        "discharge",
        "after",
        "behind",
        "downstream",
        "nach",
        "sort",
        "après",
        "apres",
        "aval",
        "salida",
        "uscita",
    ];
    const INLETS: [&str; 11] = [
        "inlet", "before", "upstream", "vor", "eintritt", "entr", "avant", "amont", "suction", "ingresso",
        "admis",
    ];
    // `T_comp_in`: a letter and nothing but the place.
    let letter = |letter: char| {
        place
            .strip_prefix(letter)
            .filter(|rest| matches!(*rest, "in" | "inlet" | "vor" | "out" | "outlet" | "nach"))
    };
    let is_outlet = has(&OUTLETS);
    let is_inlet = has(&INLETS) || place.starts_with("in") || place.ends_with("in");
    let is_pressure = has(&["press", "druck", "presi"]) || letter('p').is_some();
    let is_temperature = has(&["temp"]) || letter('t').is_some();
    match (is_pressure, is_temperature, is_turbine, is_outlet) {
        (true, false, false, true) => Some(Quantity::P2),
        (true, false, true, true) => Some(Quantity::P4),
        (false, true, false, true) => Some(Quantity::T2),
        (false, true, true, true) => Some(Quantity::T4),
        (true, false, false, false) if is_inlet => Some(Quantity::P1),
        (true, false, true, false) if is_inlet => Some(Quantity::P3),
        (false, true, false, false) if is_inlet => Some(Quantity::T1),
        (false, true, true, false) if is_inlet => Some(Quantity::T3),
        _ => None,
    }
}

/// The quantity of a name in lower case with only letters, digits, `/`, `√` and `η`. The unit decides between volume and mass flow.
pub(crate) fn quantity_of_name(plain: &str, by_unit: Option<Quantity>) -> Option<Quantity> {
    let has = |words: &[&str]| words.iter().any(|word| plain.contains(word));
    let is = |words: &[&str]| words.contains(&plain);
    if has(&["fuel", "kraftstoff", "carburant", "coolant", "coolingwater", "kühlwasser"]) {
        return None;
    }
    if has(&["oil", "öl", "oel", "huile", "aceite", "olio"]) && !has(&["gasöl", "gasoil"]) {
        let is_inlet_temperature = has(&["temp"]) || plain.starts_with('t') || by_unit.is_none();
        let is_other =
            has(&["press", "druck", "presi", "flow", "durchsatz", "out", "aus", "sort", "uscita", "salida"]);
        return (is_inlet_temperature && !is_other).then_some(Quantity::Oil);
    }
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
    ]) || plain.starts_with('π')
        || has(&[
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
        ])
    {
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
        _ if has(&["turb", "abgas", "exhaust"]) || is(&["mt", "wt", "m3", "w3", "mdott"]) => {
            Quantity::TurbineFlow
        }
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
        "mt",
        "wt",
        "m3",
        "w3",
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
    for (quantity, stem) in [
        (Quantity::P1, "p1"),
        (Quantity::P2, "p2"),
        (Quantity::P3, "p3"),
        (Quantity::P4, "p4"),
        (Quantity::T1, "t1"),
        (Quantity::T2, "t2"),
        (Quantity::T3, "t3"),
        (Quantity::T4, "t4"),
    ] {
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
    quantity_of_place(plain)
}
