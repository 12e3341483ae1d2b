use std::path::Path;

use tagalong_app::choice::{COLOUR_AND_DEPTH, Choice, Fitting, WITHOUT_NETWORK, fitting};
use tagalong_app::config_file::ConfigFile;
use tagalong_app::input_args::InputArgs;
use tagalong_app::installed::{WITH_DEPTH, default_network};
use tagalong_app::outcome::{Failure, say};
use tagalong_config::Registry;

use crate::commands::is_known_network;

/// Returns the pipeline for a log, and says which and why.
///
/// # Errors
/// A log that cannot be read, or that no pipeline fits: the reasons of each.
pub(super) fn choose(
    log: &Path,
    registry: &Registry,
    args: &InputArgs,
) -> Result<ConfigFile, Failure> {
    let mut found = fitting(log, registry, args, 1);
    let contents = found.contents();
    let better = found.better();
    let Some(Fitting { choice, config }) = found.fitting.pop() else {
        return Err(found.none_fits(log));
    };
    let Choice { config: name, reason } = choice;
    say(&format!("the log has {contents}: taking {}, because {reason}", config.stem()));
    if let Some(better) = better {
        say(&better);
    }
    if name == COLOUR_AND_DEPTH
        && let Some(network) = default_network()
    {
        let joined = format!("{network}{WITH_DEPTH}");
        if ConfigFile::named(&joined).is_some() {
            say(&joined_line(&joined, is_known_network(&network)));
        }
    }
    if name == WITHOUT_NETWORK {
        say(
            "a neural network finds more people in colour: `tagalong model --list` names some, and \
             after `tagalong model --install FILE.onnx` this command takes it",
        );
    }
    Ok(config)
}

/// Returns the line about the config that joins a network with depth. Only networks with figures on
/// recorded logs are said to have found more.
fn joined_line(joined: &str, has_figures: bool) -> String {
    let gain = if has_figures {
        "found more people in the annotated rooms, but confused more of them in a crowd"
    } else {
        "joins your network with depth"
    };
    format!(
        "`tagalong run {joined} LOG` {gain}; each frame takes longer by one call of the network"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_networks_with_figures_are_said_to_find_more_people() {
        assert!(is_known_network("yolox-nano") && !is_known_network("own"));
        let known = joined_line("yolox-nano-depth", true);
        assert!(
            known.starts_with(
                "`tagalong run yolox-nano-depth LOG` found more people in the annotated rooms, but"
            ),
            "{known}"
        );
        let own = joined_line("own-depth", false);
        assert!(own.contains("joins your network with depth"), "{own}");
        assert!(!own.contains("more people"), "{own}");
    }
}
