//! Computes a workload and compares it with its exact row, in f64.
//!
//! `cargo bench -p softrast-tests --bench exact_row -- NAME reference|TOLERANCE`
//!
//! NAME is sphere, fox, airplane, chair, or with the paper's meshes w1, w2 or spot64, which is w2 at 64 × 64 pixels, to save memory. A
//! tolerance, such as 1e-5, runs the fused op; `reference` evaluates every pair, which takes minutes.

use std::{env, time::Instant};

use softrast_lab::peak_rss_mib;
use softrast_tensor::NdArray;
use softrast_tests::{KnownRow, Row, Workload};

type B = NdArray<f64>;

/// The workload of this name, and its exact row if it is known.
fn named(name: &str) -> (Workload, Option<Row>) {
    let known = match name {
        "w1" => KnownRow::w1(),
        "w2" => KnownRow::w2(),
        "spot64" => return (Workload { size: 64, ..KnownRow::w2().workload }, None),
        _ => KnownRow::ours().into_iter().find(|known| known.name == name).unwrap_or_else(|| {
            panic!("unknown workload {name:?}: see the first lines of the bench")
        }),
    };
    (known.workload, Some(known.row))
}

fn main() {
    // Cargo adds the flag `--bench`.
    let mut arguments = env::args().skip(1).filter(|argument| argument != "--bench");
    let mut argument = || arguments.next().expect("usage: NAME reference|TOLERANCE");
    let (workload, exact) = named(&argument());
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
