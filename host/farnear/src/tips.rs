//! Tips for bad usage that the argument parser does not give itself.

use std::path::Path;

use clap::{
    Arg, Command, Error,
    error::{ContextKind, ContextValue, ErrorKind},
};
use farnear_files::video::pictures::EXTENSIONS;

/// Positional arguments that take a folder of pictures.
const FOLDERS: [&str; 3] = ["masks", "stack", "video"];

pub fn tip(error: &Error, program: &Command, words: &[String]) -> Option<String> {
    let (mut command, mut name) = (program, program.get_name().to_owned());
    for word in words {
        let Some(found) = command.find_subcommand(word) else { break };
        command = found;
        name = format!("{name} {word}");
    }
    let invalid = |kind| match error.get(kind) {
        Some(ContextValue::String(word)) => Some(word.as_str()),
        _ => None,
    };
    match error.kind() {
        ErrorKind::UnknownArgument => without_equals(command, words)
            .or_else(|| one_of_several(command, invalid(ContextKind::InvalidArg)?))
            .or_else(|| without_option(command, invalid(ContextKind::InvalidArg)?)),
        ErrorKind::InvalidSubcommand if error.get(ContextKind::SuggestedSubcommand).is_none() => {
            match name == program.get_name() {
                true => elsewhere(program, invalid(ContextKind::InvalidSubcommand)?),
                false => {
                    let commands: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
                    Some(format!("one of its commands follows `{name}`: {}", commands.join(", ")))
                }
            }
        }
        _ => None,
    }
}

/// For the first option whose value must follow `=` and that is followed by a space.
fn without_equals(command: &Command, words: &[String]) -> Option<String> {
    words.windows(2).find_map(|two| {
        let (flag, value) = (two[0].strip_prefix("--")?, &two[1]);
        let option = command.get_arguments().find(|option| option.get_long() == Some(flag))?;
        let optional = option.is_require_equals_set() && !value.starts_with('-');
        optional.then(|| format!("the value of --{flag} follows an equals sign: --{flag}={value}"))
    })
}

/// A shell replaces a pattern such as `a/*.jpg` by its pictures; the second one is not expected.
fn one_of_several(command: &Command, word: &str) -> Option<String> {
    let file = Path::new(word);
    let ending = file.extension()?.to_string_lossy().to_lowercase();
    let mut positional = command.get_positionals().map(|argument| argument.get_id().as_str());
    let takes_a_folder = positional.any(|id| FOLDERS.contains(&id));
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    (takes_a_folder && EXTENSIONS.contains(&ending.as_str()))
        .then(|| format!("give the folder of the pictures: {}", folder.display()))
}

/// For a file, and a command that takes one by a single option only.
fn without_option(command: &Command, word: &str) -> Option<String> {
    let is_number = word.parse::<f64>().is_ok();
    let is_file = !is_number && !word.starts_with('-') && Path::new(word).extension().is_some();
    let is_input = |option: &&Arg| {
        let values = option.get_value_names().unwrap_or_default();
        option.get_long() != Some("out") && values.iter().any(|name| name.as_str() == "FILE")
    };
    let mut inputs = command.get_arguments().filter(is_input);
    let (Some(option), None) = (inputs.next(), inputs.next()) else { return None };
    let option = option.get_long()?;
    let only_by_option = is_file && command.get_positionals().next().is_none();
    only_by_option.then(|| format!("a file is given by an option: --{option} {word}"))
}

/// For a word that is the name, or a part of the name, of commands anywhere in the program.
fn elsewhere(program: &Command, word: &str) -> Option<String> {
    fn collect(command: &Command, name: &str, word: &str, found: &mut Vec<String>) {
        for command in command.get_subcommands() {
            let (last, name) = (command.get_name(), format!("{name} {}", command.get_name()));
            if last == word || last.split('-').any(|part| part == word) {
                found.push(format!("`{name}`"));
            }
            collect(command, &name, word, found);
        }
    }
    let mut found = Vec::new();
    collect(program, program.get_name(), word, &mut found);
    (!found.is_empty()).then(|| format!("similar commands: {}", found.join(", ")))
}
