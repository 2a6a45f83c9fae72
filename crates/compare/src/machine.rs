use std::{fs, thread::available_parallelism};

/// How many cores of which processor there are, as far as the system tells.
pub(crate) fn machine() -> String {
    let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let mut names = cpuinfo.lines().filter_map(|line| line.strip_prefix("model name"));
    let name = names.find_map(|name| name.split(": ").nth(1)).unwrap_or("an unknown processor");
    let cores = available_parallelism().map_or(1, |cores| cores.get());
    format!("{cores} cores of {name}")
}
