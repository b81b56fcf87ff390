//! How exact capacitances are, how continuous, and how that is known: three stripes in air and bodies near them, compared
//! with reference values.
//!
//! ```sh
//! cargo run --release --example accuracy                 # tables of errors; --quick for small lattices
//! cargo run --release --example accuracy -- continuity   # a moving bar; writes continuity.csv and continuity.svg
//! cargo run --release --example accuracy -- converge     # where the reference values come from
//! cargo run --release --example accuracy -- rims         # rims of thin electrodes; --quick for small lattices
//! cargo run --release --example accuracy -- domain       # what the wall changes, and an open one; --quick for less
//! cargo run --release --example accuracy -- fitted       # boxes with faces in planes of the mesh, and between them
//! cargo run --release --example accuracy -- bars         # error bars against errors; --quick for small lattices
//! cargo run --release --example accuracy -- layouts      # lattices for electrodes of many layouts; --quick, --only NAME
//! cargo run --release --example accuracy -- meshes       # what tolerances cost on each kind of mesh; --quick for two of three
//! cargo run --release --example accuracy -- ends         # factors of weights near ends of thin plates; --errors, --quick
//! ```

mod bars;
mod cases;
mod continuity;
mod converge;
mod domain;
mod ends;
mod fitted;
mod layouts;
mod measure;
mod meshes;
mod plates;
mod plot;
mod references;
mod rims;
mod section;
mod statistics;
mod table;

use clap::{Parser, Subcommand};

/// How exact and how continuous capacitances are: three stripes in air and bodies near them
#[derive(Debug, Parser)]
#[command(args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    table: table::TableArguments,
}

#[derive(Debug, Subcommand)]
enum Command {
    Bars(bars::BarsArguments),
    Table(table::TableArguments),
    Continuity(continuity::ContinuityArguments),
    Converge(converge::ConvergeArguments),
    Rims(rims::RimsArguments),
    Domain(domain::DomainArguments),
    Fitted(fitted::FittedArguments),
    Layouts(layouts::LayoutsArguments),
    Meshes(meshes::MeshesArguments),
    Ends(ends::EndsArguments),
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    match arguments.command {
        None => table::table(&arguments.table),
        Some(Command::Bars(arguments)) => bars::bars(&arguments),
        Some(Command::Table(arguments)) => table::table(&arguments),
        Some(Command::Continuity(arguments)) => continuity::continuity(&arguments),
        Some(Command::Converge(arguments)) => converge::converge(&arguments),
        Some(Command::Rims(arguments)) => rims::rims(&arguments),
        Some(Command::Domain(arguments)) => domain::domain(&arguments),
        Some(Command::Fitted(arguments)) => fitted::fitted(&arguments),
        Some(Command::Layouts(arguments)) => layouts::layouts(&arguments),
        Some(Command::Meshes(arguments)) => meshes::meshes(&arguments),
        Some(Command::Ends(arguments)) => ends::ends(&arguments),
    }
}
