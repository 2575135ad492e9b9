//! Processes that call readers, and what watches them.

use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::corpus::Seed;
use crate::mutate::{Dice, mutated};
use crate::{Campaign, MEMORY_KB, folder, readers};

/// Processes at work at once.
const PROCESSES: u64 = 2;
/// Inputs of one process.
const BATCH: u64 = 250;
/// A reader that takes longer than this for an input hangs. The inputs are small.
const HANG: Duration = Duration::from_secs(30);
/// Variable that tells a process its work: `FROM TO SEED CORPUS WORK`.
const WORK: &str = "SKYSWEEP_FUZZ_WORK";

/// Tries the inputs of a campaign. Returns how many were tried, and the failures.
pub(crate) fn try_all(corpus: &[Seed], campaign: Campaign) -> (u64, Vec<String>) {
    let begun = Instant::now();
    let home = corpus.first().and_then(|seed| seed.path.ancestors().nth(2)).expect("a corpus").to_owned();
    let share = |process: u64| {
        let (mut tried, mut failures) = (0, Vec::new());
        let mut from = process * BATCH;
        while from < campaign.count && begun.elapsed() < campaign.time {
            let to = (from + BATCH).min(campaign.count);
            tried += batch(&home, process, (from, to), campaign, begun, &mut failures);
            from += PROCESSES * BATCH;
        }
        (tried, failures)
    };
    std::thread::scope(|scope| {
        let all: Vec<_> = (0..PROCESSES).map(|process| scope.spawn(move || share(process))).collect();
        all.into_iter().map(|one| one.join().expect("a watcher")).fold((0, Vec::new()), |mut sum, one| {
            sum.0 += one.0;
            sum.1.extend(one.1);
            sum
        })
    })
}

/// Tries a range of inputs in as many processes as it takes. Returns how many were tried.
fn batch(
    corpus: &Path,
    process: u64,
    (from, to): (u64, u64),
    campaign: Campaign,
    begun: Instant,
    failures: &mut Vec<String>,
) -> u64 {
    let work = folder(&format!("work_{process}"));
    let current = work.join("current");
    let mut next = from;
    while next < to && begun.elapsed() < campaign.time {
        std::fs::write(&current, next.to_string()).unwrap();
        let _ = std::fs::remove_file(work.join("panics"));
        let mut child = start(corpus, &work, (next, to), campaign.seed);
        let end = watch(&mut child, &current, begun + campaign.time);
        failures.extend(
            std::fs::read_to_string(work.join("panics"))
                .into_iter()
                .flat_map(|text| text.lines().map(str::to_owned).collect::<Vec<_>>()),
        );
        let reached: u64 = std::fs::read_to_string(&current).unwrap().trim().parse().expect("a number");
        match end {
            End::Done | End::OutOfTime => return if matches!(end, End::Done) { to - from } else { reached - from },
            End::Failed(how) => {
                failures.push(format!("input {reached}, seed {}: {how}; {}", campaign.seed, keep(&work, reached)));
            }
        }
        next = reached + 1;
    }
    next - from
}

/// How a process ended.
enum End {
    Done,
    OutOfTime,
    Failed(String),
}

fn start(corpus: &Path, work: &Path, (from, to): (u64, u64), seed: u64) -> Child {
    let script = format!("ulimit -v {MEMORY_KB}; exec \"$0\" \"$@\"");
    Command::new("bash")
        .args(["-c", &script])
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", "worker::one_process_calls_readers", "--nocapture", "--test-threads", "1"])
        .env(WORK, format!("{from}\n{to}\n{seed}\n{}\n{}", corpus.display(), work.display()))
        .env("RAYON_NUM_THREADS", "2")
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(work.join("stderr")).unwrap())
        .spawn()
        .unwrap()
}

/// Waits for a process, and ends it when it stands still or the time is over.
fn watch(child: &mut Child, current: &Path, end: Instant) -> End {
    let number = || std::fs::read_to_string(current).unwrap_or_default();
    let (mut last, mut since) = (number(), Instant::now());
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            let signal =
                || status.signal().map_or_else(|| format!("exit code {:?}", status.code()), |s| format!("signal {s}"));
            return if status.success() {
                End::Done
            } else {
                End::Failed(format!("the process died with {}", signal()))
            };
        }
        let now = number();
        if now != last {
            (last, since) = (now, Instant::now());
        }
        let is_over = Instant::now() > end;
        if is_over || since.elapsed() > HANG {
            child.kill().unwrap();
            child.wait().unwrap();
            return if is_over { End::OutOfTime } else { End::Failed("it hangs".to_owned()) };
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Keeps the files of an input that failed, and tells where.
fn keep(work: &Path, number: u64) -> String {
    let kept = folder("failures").join(number.to_string());
    let _ = std::fs::remove_dir_all(&kept);
    let copied = Command::new("cp").arg("-r").arg(work.join("input")).arg(&kept).status();
    let last = std::fs::read_to_string(work.join("stderr")).unwrap_or_default();
    let last = last.lines().last().unwrap_or_default().to_owned();
    format!("{last}; kept ({}) in {}", copied.is_ok_and(|s| s.success()), kept.display())
}

/// The work of a process that [`start`] started. Without its variable this is no process of a
/// campaign, and there is nothing to do.
#[test]
fn one_process_calls_readers() {
    let Ok(text) = std::env::var(WORK) else { return };
    let [from, to, seed, corpus, work] = &text.lines().collect::<Vec<_>>()[..] else { panic!("{text:?}") };
    let (from, to, seed): (u64, u64, u64) = (from.parse().unwrap(), to.parse().unwrap(), seed.parse().unwrap());
    let work = Path::new(work);
    let seeds = crate::corpus::read(Path::new(corpus));
    let place = std::sync::Arc::new(std::sync::Mutex::new(String::new()));
    let seen = place.clone();
    std::panic::set_hook(Box::new(move |info| *seen.lock().unwrap() = info.to_string().replace('\n', " ")));
    let mut panics = String::new();
    for number in from..to {
        std::fs::write(work.join("current"), number.to_string()).unwrap();
        let mut dice = Dice::new(seed, number);
        let chosen = dice.one_of(&seeds);
        let path = prepare(chosen, dice.one_of(&seeds).clone(), &work.join("input"), &mut dice);
        let call = || drop(readers::call(chosen.reader, &path));
        if std::panic::catch_unwind(std::panic::AssertUnwindSafe(call)).is_err() {
            let kept = keep(work, number);
            panics += &format!("input {number}, seed {seed}, {:?}: {}; {kept}\n", chosen.reader, place.lock().unwrap());
            std::fs::write(work.join("panics"), &panics).unwrap();
        }
    }
}

/// Writes a mutated input with the files that belong to it. Sometimes one of those is mutated.
fn prepare(seed: &Seed, other: Seed, folder: &Path, dice: &mut Dice) -> std::path::PathBuf {
    let _ = std::fs::remove_dir_all(folder);
    std::fs::create_dir_all(folder).unwrap();
    let other = std::fs::read(other.path).unwrap();
    let mut files: Vec<_> =
        std::fs::read_dir(seed.path.parent().unwrap()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let victim = if dice.below(4) == 0 { dice.one_of(&files).clone() } else { seed.path.clone() };
    for file in &files {
        let bytes = std::fs::read(file).unwrap();
        let bytes = if *file == victim { mutated(&bytes, &other, dice) } else { bytes };
        std::fs::write(folder.join(file.file_name().unwrap()), bytes).unwrap();
    }
    folder.join(seed.path.file_name().unwrap())
}
