# List the recipes.
default:
    @just --list

# Everything a change has to pass: format, lints, documentation, tests.
check:
    .ci/run

# Tests only, all or those whose names contain the arguments.
test *names:
    cargo test --release -- {{ names }}

# Train an agent: `just train --help` shows the options.
train *options:
    cargo run --release -- train {{ options }}

# Run any command: `just drape eval runs/NAME`.
drape *arguments:
    cargo run --release -- {{ arguments }}

# Measure steps of the simulation and of the task.
bench *names:
    cargo bench -- {{ names }}

# Format the sources.
fmt:
    cargo fmt
