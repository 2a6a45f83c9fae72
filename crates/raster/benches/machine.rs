//! Description of the machine that a benchmark runs on.

use std::fs;

/// Processor, threads in use and load averages, as reported by the system.
pub(crate) fn machine() -> String {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let cpuinfo = read("/proc/cpuinfo");
    let model =
        cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    let load = read("/proc/loadavg");
    let load: Vec<_> = load.split_whitespace().take(3).collect();
    let threads = match rayon::current_num_threads() {
        1 => "1 thread".to_owned(),
        many => format!("{many} threads"),
    };
    let model = model.unwrap_or("an unknown processor");
    format!("{threads} of {model}, load averages {}", load.join(" "))
}
