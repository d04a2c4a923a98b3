//! The command line: parses arguments and prints figures; the tasks are in `farnear-workflows`. [`render`] is here
//! because the workflows do not depend on a simulated lens.
//!
//! Exit code 0 only on success, 1 for failure, 2 for bad usage, 141 if stdout was closed. Figures go to stdout,
//! everything else to stderr.

mod commands;
mod hang_up;
mod hints;
#[cfg(target_os = "linux")]
mod huge_pages;
mod render;
mod report;
mod run;
mod scene;
mod terminal;
mod tips;

use std::{
    ffi::OsString,
    io::{self, Write},
    process::ExitCode,
};

use clap::{
    Arg, CommandFactory, FromArgMatches, Parser, Subcommand,
    error::{ContextKind, ContextValue},
};
use farnear_workflows::{
    WorkflowError, compare::CompareRequest, correct::CorrectRequest, depth::DepthRequest,
    focus_stack::FocusStackRequest, operators::OperatorRequest, optics::OpticsRequest, report::ReportRequest,
    sun::SunPositionRequest, target::TargetRequest,
};

use run::Run;

#[cfg(target_os = "linux")]
#[global_allocator]
static ALLOCATOR: huge_pages::HugePages = huge_pages::HugePages;

/// Depth from defocus: design operators, compute depth, drive the rig.
#[derive(Parser)]
#[command(
    name = "farnear",
    version,
    arg_required_else_help = true,
    propagate_version = true,
    after_help = "Example: farnear rig capture --port sim --optics optics.toml --out pair1/\n\
                  \x20        farnear depth pair1/far.png pair1/near.png --optics optics.toml"
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Optics(Run<OpticsRequest>),
    Operators(Run<OperatorRequest>),
    Depth(Run<DepthRequest>),
    FocusStack(Run<FocusStackRequest>),
    /// Learn the point spread function, a correction of the lens's distortion, the camera's own frames, or a whole lens from a z-stack.
    #[command(
        subcommand,
        after_help = "Example: farnear calibrate psf far.png near.png --optics optics.toml --model gaussian"
    )]
    Calibrate(commands::Calibrate),
    /// Cameras without a rig: which there are, what can be set, pictures to keep and to look at (docs/cameras.md).
    #[command(subcommand, after_help = "Example: farnear camera list")]
    Camera(commands::camera::Job),
    Correct(Run<CorrectRequest>),
    Compare(Run<CompareRequest>),
    Render(commands::render::Arguments),
    /// Drive a rig: home, move, focus, capture, calibrate, and everything else the board can do.
    #[command(
        subcommand,
        after_help = "Example: farnear rig capture --port sim --optics optics.toml --out pair1/"
    )]
    Rig(commands::rig::Job),
    Sun(Run<SunPositionRequest>),
    /// Remove a person's shadow from masks by the place of the sun, and score the result.
    #[command(subcommand, after_help = "Example: farnear shadow score masks/ truth/ --json")]
    Shadow(commands::Shadow),
    /// Make silhouettes: masks of the person who moves in a video, or of a motion-capture recording from any view.
    #[command(
        subcommand,
        after_help = "Example: farnear silhouettes video walk.y4m --out masks/ --learn-first"
    )]
    Silhouettes(commands::Silhouettes),
    /// Recognise what people do from their silhouettes: train a model, use it, evaluate the method.
    #[command(
        subcommand,
        after_help = "Example: farnear activity recognise masks/ --model everyday\n\
                        \x20        farnear activity train samples.toml --out model.fnm\n\
                        \x20        farnear activity recognise masks/ --model model.fnm"
    )]
    Activity(commands::activity::Job),
    Batch(commands::batch::Arguments),
    /// Measure in a depth map: a region, the plane through it, a profile, the difference to another.
    #[command(
        subcommand,
        after_help = "Example: farnear measure region pair1/ --region 100,80,60,40 --json\n\
                        \x20        farnear measure profile pair1/ --from 0,240 --to 639,240 --json"
    )]
    Measure(commands::Measure),
    Target(Run<TargetRequest>),
    Report(Run<ReportRequest>),
    Serve(commands::serve::Arguments),
    Doctor(commands::doctor::Arguments),
    Completions(commands::completions::Arguments),
    Man(commands::man::Arguments),
}

fn main() -> ExitCode {
    let result = parse().and_then(|command| command.map_or(Ok(()), execute));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Not returned from main: RUST_BACKTRACE would add a backtrace to the message.
        Err(error) => {
            terminal::end_count();
            if report::is_closed(&error) {
                return ExitCode::from(report::CLOSED);
            }
            let hint = hints::hint(&error).map(|hint| format!("; {hint}")).unwrap_or_default();
            terminal::say(&format!("farnear: {}{hint}\n", message(&error)));
            let usage =
                error.is::<report::Usage>() || error.downcast_ref().is_some_and(WorkflowError::is_usage);
            if usage { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}

fn execute(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Optics(task) => task.run(),
        Command::Operators(task) => task.run(),
        Command::Depth(task) => task.run(),
        Command::FocusStack(task) => task.run(),
        Command::Calibrate(task) => task.run(),
        Command::Camera(arguments) => commands::camera::run(arguments),
        Command::Correct(task) => task.run(),
        Command::Compare(task) => task.run(),
        Command::Render(arguments) => commands::render::run(arguments),
        Command::Rig(arguments) => commands::rig::run(arguments),
        Command::Sun(task) => task.run(),
        Command::Shadow(task) => task.run(),
        Command::Silhouettes(task) => task.run(),
        Command::Activity(arguments) => commands::activity::run(arguments),
        Command::Batch(arguments) => commands::batch::run(arguments),
        Command::Measure(task) => task.run(),
        Command::Target(task) => task.run(),
        Command::Report(task) => task.run(),
        Command::Serve(arguments) => commands::serve::run(arguments),
        Command::Doctor(arguments) => commands::doctor::run(arguments),
        Command::Completions(arguments) => commands::completions::run::<Arguments>(arguments),
        Command::Man(arguments) => commands::man::run::<Arguments>(&arguments),
    }
}

/// Parses the command line; some errors get a tip. `None` if it asks for help or the version, which is printed.
fn parse() -> anyhow::Result<Option<Command>> {
    let mut error = match parsed(std::env::args_os()) {
        Ok(arguments) => return Ok(Some(arguments.command)),
        Err(error) => error,
    };
    if !error.use_stderr() {
        report::written(error.print().and_then(|()| io::stdout().flush()))?;
        return Ok(None);
    }
    let words: Vec<String> =
        std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    if let Some(tip) = tips::tip(&error, &Arguments::command(), &words) {
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error.exit()
}

fn parsed(words: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<Arguments, clap::Error> {
    let mut command = with_negative_numbers(Arguments::command());
    let mut matches = command.try_get_matches_from_mut(words)?;
    Arguments::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut command))
}

/// A negative number after an option is its value, so that the option itself refuses it.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let allowing = |option: Arg| {
        let has_value = option.get_long().is_some() && option.get_action().takes_values();
        if has_value { option.allow_negative_numbers(true) } else { option }
    };
    command.mut_args(allowing).mut_subcommands(with_negative_numbers)
}

/// An error and its causes in one line, without causes that the error's message already contains.
fn message(error: &anyhow::Error) -> String {
    let causes = error.chain().map(|cause| cause.to_string().trim_end().to_owned());
    causes.fold(String::new(), |message, cause| match message {
        empty if empty.is_empty() => cause,
        message if message.contains(&cause) => message,
        message => format!("{message}: {cause}"),
    })
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use clap::Args;
    use farnear_workflows::request::{DEVICE_TASKS, TASKS};

    use super::*;
    use crate::commands::rig::target::{CameraArguments, Target};

    /// Options of the command line only.
    const ONLY_HERE: [&str; 3] = ["json", "help", "version"];

    #[test]
    fn a_negative_number_is_the_value_of_the_option_before_it() {
        for words in [
            ["calibrate", "stack", "slices", "--out", "lens.toml", "--step-mm", "-0.083"],
            ["depth", "far.png", "near.png", "--optics", "optics.toml", "--min-confidence", "-1"],
        ] {
            let error = parsed(["farnear"].into_iter().chain(words)).err().map(|error| error.to_string());
            assert_eq!(error, None);
        }
    }

    #[test]
    fn options_of_commands_are_the_fields_of_their_requests() {
        let command = Arguments::command();
        let equipment = clap::Command::new("rig");
        let equipment = CameraArguments::augment_args(Target::augment_args(equipment));
        let equipment: BTreeSet<_> =
            equipment.get_arguments().map(|option| option.get_id().to_string()).collect();
        for task in TASKS.iter().chain(DEVICE_TASKS) {
            let find = |command: &clap::Command, word: &str| command.find_subcommand(word).cloned();
            let found = task.name.split(' ').try_fold(command.clone(), |command, word| find(&command, word));
            let mut found = found.unwrap_or_else(|| panic!("no command for the task {}", task.name));
            found.build();
            let options: BTreeMap<_, _> = found
                .get_arguments()
                .filter(|option| !ONLY_HERE.contains(&option.get_id().as_str()))
                .filter(|option| {
                    !task.name.starts_with("rig ") || !equipment.contains(option.get_id().as_str())
                })
                .map(|option| (option.get_id().to_string(), option))
                .collect();
            let schema = (task.schema)();
            let fields = schema["properties"].as_object().expect("a struct");
            let names = |keys: Vec<&String>| keys.into_iter().cloned().collect::<BTreeSet<_>>();
            assert_eq!(names(options.keys().collect()), names(fields.keys().collect()), "{}", task.name);
            let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
            let help = found.get_long_about().or(found.get_about()).map(ToString::to_string);
            let about = words(schema["description"].as_str().unwrap_or_default());
            let help = words(&help.unwrap_or_default());
            assert_eq!(help.trim_end_matches('.'), about.trim_end_matches('.'), "{}", task.name);
            for (name, option) in options {
                let field = &fields[&name];
                let help = option.get_long_help().or(option.get_help()).map(ToString::to_string);
                let help = help.unwrap_or_else(|| panic!("{}: {name} has no help", task.name));
                let about = words(field["description"].as_str().unwrap_or_default());
                assert_eq!(words(&help), about.trim_end_matches('.'), "{}: {name}", task.name);
                let default = option.get_default_values().first().map(|value| value.to_string_lossy());
                let Some(default) =
                    default.filter(|_| option.get_num_args().is_some_and(|n| n.takes_values()))
                else {
                    continue;
                };
                let text = match &field["default"] {
                    serde_json::Value::String(text) => text.clone(),
                    other => other.to_string(),
                };
                let number = |text: &str| text.parse::<f64>().ok();
                let same_number = number(&default).is_some_and(|given| number(&text) == Some(given));
                assert!(default == text || same_number, "{}: {name} = {text}, {default} here", task.name);
            }
        }
    }

    #[test]
    fn causes_are_printed_once() {
        let cause = anyhow::anyhow!("line 2\n  bad\n");
        let error = cause.context("samples.toml: line 2\n  bad\n").context("training");
        assert_eq!(message(&error), "training: samples.toml: line 2\n  bad");
        let unsaid = anyhow::anyhow!("No such file").context("cannot read x");
        assert_eq!(message(&unsaid), "cannot read x: No such file");
    }
}
