use clap::Parser;
use drape_study::study::{Context, Study};
#[derive(Parser)]
struct Args { #[command(flatten)] it: drape_study::episodes::Episodes }
fn main() {
    let args = Args::parse();
    let report = match args.it.run(&Context::quiet()) { Ok(r) => r, Err(e) => panic!("{e}") };
    for table in &report.tables { if !table.is_hidden() { println!("{}", table.text()); } }
}
