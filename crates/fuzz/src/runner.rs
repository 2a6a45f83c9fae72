//! Passes inputs to readers, and stores those that break them.

use std::{
    any::Any,
    fs,
    panic::{self, AssertUnwindSafe},
    path::{Path, PathBuf},
    process::{self, ExitCode},
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    thread,
    time::{Duration, Instant},
};

use cpu_time::ProcessTime;

use crate::{Mutator, Settings, allocator};

/// CPU time of the process per input above which a reader hangs, in each of three tries. Waiting counts only towards `FOR_EVER`: a loaded
/// machine would give false positives.
const LONGEST: Duration = Duration::from_secs(1);
/// Seconds after which a reader counts as endless, and the process ends.
const FOR_EVER: u64 = 120;
/// Memory per input above which a reader takes too much, in bytes.
const MOST: usize = 1 << 30;
/// Most inputs stored per reader.
const MOST_KEPT: usize = 20;

type Read<'a> = Box<dyn Fn(&[u8]) + 'a>;

/// A reader under test.
pub struct Reader<'a> {
    name: &'static str,
    ending: &'static str,
    seeds: Vec<Vec<u8>>,
    read: Read<'a>,
}

impl<'a> Reader<'a> {
    /// A reader called `name`, for files with the extension `ending` (without the dot); `seeds` are valid files to start from. `read` may
    /// panic only if the reader, or its result, violates its contract.
    ///
    /// # Panics
    ///
    /// If there are no `seeds`.
    pub fn new(
        name: &'static str,
        ending: &'static str,
        seeds: Vec<Vec<u8>>,
        read: impl Fn(&[u8]) + 'a,
    ) -> Self {
        assert!(!seeds.is_empty(), "{name} has files to begin with");
        Self { name, ending, seeds, read: Box::new(read) }
    }
}

/// The findings of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Number of inputs read.
    pub inputs: u64,
    /// Inputs on which a reader panicked.
    pub panics: u64,
    /// Inputs that took more than a second of CPU time, in three tries.
    pub hangs: u64,
    /// Inputs that took more than 1 GiB of memory.
    pub large: u64,
    /// Largest memory of an input, in bytes.
    pub peak: usize,
}

impl Report {
    /// Whether there are no findings.
    pub fn is_clean(&self) -> bool {
        self.panics + self.hangs + self.large == 0
    }

    fn add(&mut self, other: &Self) {
        self.inputs += other.inputs;
        self.panics += other.panics;
        self.hangs += other.hangs;
        self.large += other.large;
        self.peak = self.peak.max(other.peak);
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { inputs, panics, hangs, large, peak } = self;
        let peak = peak.div_ceil(1 << 20);
        write!(f, "inputs {inputs}, panics {panics}, hangs {hangs}, ")?;
        if *large > 0 {
            write!(f, "above 1024 MiB {large}, ")?;
        }
        write!(f, "largest peak {peak} MiB")
    }
}

/// Entry point of a fuzz target: parses the command line (see [`Settings`]), runs all readers, and prints the seed, a line per reader and
/// one for all. It fails if there are findings.
pub fn main(readers: Vec<Reader<'_>>) -> ExitCode {
    let settings = match Settings::parse(std::env::args().skip(1)) {
        Ok(settings) => settings,
        Err(message) => {
            eprintln!("error: {message}");
            return ExitCode::from(2);
        }
    };
    match run(&settings, &readers) {
        Ok(report) => {
            println!("{report}");
            if report.is_clean() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(reason) => {
            eprintln!("error: {}: cannot be written: {reason}", settings.keep.display());
            ExitCode::from(2)
        }
    }
}

/// Runs the readers selected by the settings, and prints the seed, and a line for each reader and each finding.
///
/// An input that breaks a reader is written to the folder of the settings, named after the reader, the seed and its number. An input that
/// ends the process (no memory, no stack, no end) remains there as `NAME-running.ENDING`.
///
/// # Errors
///
/// If the folder of the settings cannot be written.
pub fn run(settings: &Settings, readers: &[Reader<'_>]) -> std::io::Result<Report> {
    fs::create_dir_all(&settings.keep)?;
    let readers: Vec<_> =
        readers.iter().filter(|reader| reader.name.starts_with(&settings.only)).collect();
    println!("seed {}, {} readers", settings.seed, readers.len());
    let watch = Watch::default();
    let old = panic::take_hook();
    panic::set_hook(Box::new(|_| ()));
    let all = thread::scope(|scope| {
        scope.spawn(|| watch.run());
        let all = readers.iter().map(|reader| {
            let share = settings.time / readers.len() as u32;
            let report = reader.run(settings, share, &watch)?;
            println!("{}: {report}", reader.name);
            Ok(report)
        });
        let all = all.collect::<std::io::Result<Vec<_>>>();
        watch.end();
        all
    });
    panic::set_hook(old);
    let mut report = Report::default();
    all?.iter().for_each(|one| report.add(one));
    Ok(report)
}

impl Reader<'_> {
    fn run(&self, settings: &Settings, share: Duration, watch: &Watch) -> std::io::Result<Report> {
        let Self { name, ending, .. } = self;
        let running = settings.keep.join(format!("{name}-running.{ending}"));
        let (start, mut report, mut kept) = (Instant::now(), Report::default(), 0);
        // The valid files come first, unchanged.
        let sound = self.seeds.len() as u64;
        for number in 0..settings.inputs + sound {
            if start.elapsed() > share {
                break;
            }
            let input = match self.seeds.get(number as usize) {
                Some(seed) => seed.clone(),
                None => Mutator::new(&self.seeds, settings.seed, name, number - sound).input(),
            };
            fs::write(&running, &input)?;
            watch.begin(&running);
            let reading = self.read(&input);
            watch.pause();
            report.inputs += 1;
            report.peak = report.peak.max(reading.peak);
            let found = match &reading {
                Reading { panic: Some(message), .. } => {
                    report.panics += 1;
                    format!("panic: {message}")
                }
                Reading { time, .. } if *time > LONGEST => {
                    report.hangs += 1;
                    format!("{:.1} s", time.as_secs_f64())
                }
                Reading { peak, .. } if *peak > MOST => {
                    report.large += 1;
                    format!("{} MiB", peak >> 20)
                }
                _ => continue,
            };
            kept += 1;
            if kept <= MOST_KEPT {
                let path =
                    settings.keep.join(format!("{name}-{}-{number}.{ending}", settings.seed));
                fs::write(&path, &input)?;
                println!("{}: {found}", path.display());
            }
        }
        let _gone = fs::remove_file(&running);
        Ok(report)
    }

    /// Reads an input; repeatedly if it takes long, since caches may have been cold.
    fn read(&self, input: &[u8]) -> Reading {
        let mut reading = self.read_once(input);
        for _ in 0..2 {
            if reading.time > LONGEST && reading.panic.is_none() {
                let again = self.read_once(input);
                reading.time = reading.time.min(again.time);
            }
        }
        reading
    }

    fn read_once(&self, input: &[u8]) -> Reading {
        let before = allocator::begin();
        let start = ProcessTime::now();
        let ended = panic::catch_unwind(AssertUnwindSafe(|| (self.read)(input)));
        let time = start.elapsed();
        let peak = allocator::peak().saturating_sub(before);
        Reading { panic: ended.err().map(|payload| message(&*payload)), time, peak }
    }
}

/// Result of a reader for an input.
struct Reading {
    panic: Option<String>,
    /// CPU time of the process.
    time: Duration,
    peak: usize,
}

/// The first line of a panic's message.
fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message");
    text.lines().next().unwrap_or_default().chars().take(200).collect()
}

/// Ends the process if a reader does not return.
#[derive(Default)]
struct Watch {
    /// Seconds of the current input, plus one; 0 between inputs, and `ENDED` at the end.
    seconds: AtomicU64,
    running: Mutex<PathBuf>,
}

const ENDED: u64 = u64::MAX;

impl Watch {
    fn begin(&self, running: &Path) {
        if let Ok(mut path) = self.running.lock()
            && *path != running
        {
            *path = running.to_path_buf();
        }
        self.seconds.store(1, Relaxed);
    }

    fn pause(&self) {
        self.seconds.store(0, Relaxed);
    }

    fn end(&self) {
        self.seconds.store(ENDED, Relaxed);
    }

    fn run(&self) {
        // Short sleeps, so that a short run ends soon.
        let mut naps = 0;
        loop {
            thread::sleep(Duration::from_millis(50));
            naps += 1;
            let next = |seconds| (naps % 20 == 0 && seconds != 0).then_some(seconds + 1);
            match self.seconds.load(Relaxed) {
                ENDED => return,
                FOR_EVER.. => {
                    let path = self.running.lock().map(|path| path.clone()).unwrap_or_default();
                    println!("{}: no end after {FOR_EVER} s", path.display());
                    process::exit(1);
                }
                seconds => {
                    if let Some(next) = next(seconds) {
                        // Another input may have started: its time is then counted from its own start.
                        let _changed =
                            self.seconds.compare_exchange(seconds, next, Relaxed, Relaxed);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(keep: &str) -> Settings {
        let keep = std::env::temp_dir().join(format!("{keep}-{}", process::id()));
        let words = ["--inputs", "500", "--keep", keep.to_str().unwrap()];
        Settings::parse(words.map(str::to_owned)).unwrap()
    }

    #[test]
    fn a_panic_is_found_and_its_input_kept_and_sound_readers_are_clean() {
        let settings = settings("softrast-fuzz-test");
        let seeds = || vec![b"12 34\n".to_vec()];
        let broken = Reader::new("broken", "txt", seeds(), |bytes| {
            assert!(!bytes.contains(&b'9'), "a nine");
        });
        let sound = Reader::new("sound", "txt", seeds(), |_| ());
        let report = run(&settings, &[broken, sound]).unwrap();
        assert_eq!(report.inputs, 1002);
        assert!(report.panics > 0 && report.hangs == 0 && !report.is_clean(), "{report}");
        let kept: Vec<_> = fs::read_dir(&settings.keep).unwrap().map(Result::unwrap).collect();
        assert!(!kept.is_empty() && kept.len() <= MOST_KEPT);
        for file in &kept {
            assert!(file.file_name().to_str().unwrap().starts_with("broken-1-"));
            assert!(fs::read(file.path()).unwrap().contains(&b'9'));
        }
        fs::remove_dir_all(&settings.keep).unwrap();
    }

    #[test]
    fn the_last_line_says_all() {
        let report = Report { inputs: 7, panics: 1, hangs: 2, large: 0, peak: (3 << 20) + 1 };
        assert_eq!(report.to_string(), "inputs 7, panics 1, hangs 2, largest peak 4 MiB");
    }
}
