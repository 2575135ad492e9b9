//! Describes the machine that a bench ran on.

/// Returns the number of cores and the processor, with family and model, which differ between
/// generations of one name.
pub(crate) fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let of = |name: &str| {
        let line = info.lines().find(|line| line.split(':').next().is_some_and(|key| key.trim() == name))?;
        Some(line.split_once(':')?.1.trim())
    };
    let generation = match (of("cpu family"), of("model")) {
        (Some(family), Some(model)) => format!(" (family {family}, model {model})"),
        _ => String::new(),
    };
    format!("{cores} cores of {}{generation}", of("model name").unwrap_or("an unknown processor"))
}
