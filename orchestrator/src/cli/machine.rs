//! What this machine has.

/// Memory (bytes) that this process may use: that of the machine, or less where its control group (a container, a
/// service) has a bound; 0 when the system does not tell.
fn memory() -> u64 {
    let info = rustix::system::sysinfo();
    let machine = u64::from(info.mem_unit) * info.totalram as u64;
    match group_bound() {
        Some(bound) if machine == 0 || bound < machine => bound,
        _ => machine,
    }
}

/// Memory (bytes) of all steps together where the user names no other; 0 when the system does not tell.
pub fn default_memory() -> u64 {
    memory() / 10 * 9
}

/// The least bound of this process's control groups, of either version.
fn group_bound() -> Option<u64> {
    let list = std::fs::read_to_string("/proc/self/cgroup").ok()?;
    let read = |file: String| {
        std::fs::read_to_string(file)
            .ok()?
            .trim()
            .parse::<u64>()
            .ok()
    };
    let mut least = None;
    for line in list.lines() {
        let mut words = line.splitn(3, ':').skip(1);
        let (controllers, path) = (words.next()?, words.next()?);
        let (root, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            c if c.split(',').any(|c| c == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        // A bound of a group above holds too; in a container the path may be that of the machine outside.
        let mut at = path.trim_end_matches('/');
        loop {
            if let Some(bound) = read(format!("{root}{at}/{file}")) {
                least = Some(least.map_or(bound, |l: u64| l.min(bound)));
            }
            match at.rfind('/') {
                Some(end) => at = &at[..end],
                None => break,
            }
        }
    }
    least
}
