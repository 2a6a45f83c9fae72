/// Most memory this process has held so far, in MiB; `None` where the system does not say.
///
/// Read from `VmHWM` of `/proc/self/status`, so Linux only.
pub fn peak_rss_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #[test]
    fn peak_memory_grows_by_what_is_touched() {
        let before = super::peak_rss_mib().unwrap();
        let touched = std::hint::black_box(vec![1_u8; 64 << 20]);
        let after = super::peak_rss_mib().unwrap();
        drop(touched);
        assert!(after - before > 32.0, "{before} to {after} MiB");
    }
}
