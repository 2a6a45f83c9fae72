use std::{fs, thread::available_parallelism};

/// Peak memory of this process so far, in MiB; `None` if the system does not report it.
///
/// Read from `VmHWM` of `/proc/self/status`, so Linux only.
pub fn peak_rss_mib() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

/// Number of cores and name of the processor, as far as the system reports them.
pub fn machine() -> String {
    let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let mut names = cpuinfo.lines().filter_map(|line| line.strip_prefix("model name"));
    let name = names.find_map(|name| name.split(": ").nth(1)).unwrap_or("an unknown processor");
    let cores = available_parallelism().map_or(1, |cores| cores.get());
    format!("{cores} cores of {name}")
}
