//! Common column names of compressor maps in tables.

/// Quantity and the names of its column, lower case without blanks, underscores and unit: corrected speed, corrected flow,
/// pressure ratio, efficiency.
pub const MAP_COLUMNS: [(&str, &[&str]); 4] = [
    (
        "corrected speed",
        &["speedcorrected", "rpm", "krpm", "nccorr", "n", "nc", "ncorr", "nred", "speed", "correctedspeed"],
    ),
    (
        "corrected flow",
        &[
            "flowcorrected",
            "wc",
            "wccorr",
            "mdot",
            "mdotcorr",
            "mcorr",
            "mred",
            "flow",
            "massflow",
            "correctedflow",
            "correctedmassflow",
            "m",
        ],
    ),
    ("pressure ratio", &["pressureratio", "prc", "pic", "pr", "prtt", "pi", "pitt", "ratio", "p2/p1"]),
    ("efficiency", &["eta", "etac", "etatt", "etais", "eff", "efficiency", "isentropicefficiency"]),
];
