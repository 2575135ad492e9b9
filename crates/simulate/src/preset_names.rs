//! Names and descriptions of the presets.

/// Name and description of every preset.
pub const PRESETS: [(&str, &str); 12] = [
    ("town", "houses, rows and halls on gentle ground, one stepped tower of 35 m"),
    ("dense-city", "closed blocks of five to seven storeys around courtyards, narrow streets"),
    ("high-rise", "towers of 60 to 150 m in a flat town"),
    ("hills", "steep forested hills"),
    ("quarry", "a pit of 60 m with benches in rock"),
    ("fields", "flat fields with parcels and crop rows, few trees"),
    ("harbour", "quays, sheds and water"),
    ("repetitive-roofs", "the same sheds again and again, at the same distance"),
    ("suburb", "small gabled houses close to one another, car ports, sheds, gardens with single trees"),
    ("dense-towers", "towers of 20 to 130 m along streets of 15 to 25 m"),
    ("industrial", "large halls under almost blank roofs"),
    ("low-texture", "the town under a veil: an eighth of the contrast"),
];
