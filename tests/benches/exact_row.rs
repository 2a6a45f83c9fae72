//! Computes a workload of DESIGN 5 and compares it with its exact row, in f64.
//!
//! `cargo bench -p softrast-tests --bench exact_row -- w1|w2|spot64 reference|TOLERANCE`
//!
//! `spot64` is W2 at 64 × 64 pixels, for its memory. A tolerance, such as 1e-5, runs the fused op;
//! `reference` evaluates every pair, which takes minutes.

use std::{env, time::Instant};

use burn::backend::NdArray;
use softrast_runner::peak_rss_mib;
use softrast_tests::{Row, Workload, w1, w2};

type B = NdArray<f64>;

fn main() {
    // Cargo adds a flag of its own.
    let mut arguments = env::args().skip(1).filter(|argument| argument != "--bench");
    let mut argument = || arguments.next().expect("usage: w1|w2|spot64 reference|TOLERANCE");
    let name = argument();
    let (workload, exact) = match name.as_str() {
        "w1" => (w1(), Some(Row::W1)),
        "w2" => (w2(), Some(Row::W2)),
        "spot64" => (w2().map(|w2| Workload { size: 64, ..w2 }), None),
        other => panic!("unknown workload {other:?}: use w1, w2 or spot64"),
    };
    let Some(workload) = workload else { return };
    let path = argument();
    let start = Instant::now();
    let row = match path.as_str() {
        "reference" => workload.by_reference::<B>(),
        tolerance => workload.by_fused_op::<B>(tolerance.parse().expect("a tolerance")),
    };
    let seconds = start.elapsed().as_secs_f64();
    println!("{row:?}");
    if let Some(exact) = exact {
        println!(
            "relative errors of loss, mean alpha and gradient norm: {:?}",
            row.errors(&exact).map(|e| format!("{e:.1e}"))
        );
    }
    let memory = peak_rss_mib().map_or("unknown".to_owned(), |mib| format!("{mib:.0} MiB"));
    println!("{seconds:.1} s, peak memory {memory}");
}
