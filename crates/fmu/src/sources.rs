//! The C files that all FMUs share.

/// Name and text of each file.
pub const SOURCES: &[(&str, &str)] = &[
    ("fmu.c", include_str!("../c/fmu.c")),
    ("machine.c", include_str!("../c/machine.c")),
    ("machine.h", include_str!("../c/machine.h")),
    ("map.c", include_str!("../c/map.c")),
    ("rodas5p.c", include_str!("../c/rodas5p.c")),
    // Unchanged headers of the standard (2-clause BSD, Modelica Association).
    ("fmi2Functions.h", include_str!("../c/fmi2/fmi2Functions.h")),
    ("fmi2FunctionTypes.h", include_str!("../c/fmi2/fmi2FunctionTypes.h")),
    ("fmi2TypesPlatform.h", include_str!("../c/fmi2/fmi2TypesPlatform.h")),
];
