use tagalong_app::config_file::ConfigFile;
use tagalong_trials::Contender;

/// Returns a config as a contender of trials.
pub fn contender(file: &ConfigFile) -> Contender {
    let folder = file.folder().to_owned();
    Contender { folder, ..Contender::new(file.stem(), file.whole_text()) }
}
