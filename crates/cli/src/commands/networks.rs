//! Networks that are known to work, and those that are installed.

use std::fmt::Write as _;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tagalong_app::installed::{
    KNOWN_NETWORKS, default_network, installed_embeddings, installed_networks,
};

/// Network that its authors publish, with its figures.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct KnownNetwork {
    /// Name as which it is installed.
    pub(super) name: String,
    /// Name of the file.
    file: String,
    bytes: u64,
    sha256: String,
    /// Objects that it finds, in words.
    finds: String,
    /// Licence of the weights.
    pub(super) licence: String,
    /// Where its authors publish it.
    pub(super) published: String,
    /// Settings of `onnx` that were chosen for it on recorded logs.
    pub(super) discover_score: Option<f64>,
    pub(super) track_score: Option<f64>,
    /// Time of a call on one thread, ms.
    call_ms: f64,
    #[serde(default)]
    result: Vec<Figures>,
}

/// Figures on one log.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Figures {
    log: String,
    hota: f64,
    recall: f64,
    false_positives_per_frame: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    /// Command by which the figures were measured.
    command: String,
    network: Vec<KnownNetwork>,
}

#[expect(clippy::expect_used, reason = "the table is part of the program, and a test reads it")]
static KNOWN: LazyLock<Table> =
    LazyLock::new(|| toml::from_str(KNOWN_NETWORKS).expect("the built-in table is right"));

/// Returns the known network whose file has this SHA-256.
pub(super) fn known_by_hash(sha256: &str) -> Option<&'static KnownNetwork> {
    KNOWN.network.iter().find(|network| network.sha256 == sha256)
}

/// Returns true if the table has figures of a network of this name.
pub(crate) fn is_known_network(name: &str) -> bool {
    KNOWN.network.iter().any(|network| network.name == name)
}

/// Returns the known and the installed networks as a text.
pub(super) fn as_text() -> String {
    let mut out = String::from("Networks that are known to work, available from their authors:\n");
    for network in &KNOWN.network {
        let KnownNetwork { name, file, finds, licence, published, call_ms, .. } = network;
        let mb = network.bytes as f64 / 1e6;
        // Writing to a string cannot fail.
        let _ = write!(out, "\n{name}: {finds}\n  {file}, {mb:.1} MB, {licence}\n  {published}\n");
        let _ = writeln!(out, "  {call_ms:.0} ms a call on one thread");
        for Figures { log, hota, recall, false_positives_per_frame } in &network.result {
            let _ = writeln!(
                out,
                "  {log:<18} HOTA {hota:.3}, recall {recall:.3}, {false_positives_per_frame:.2} \
                 false positives per frame"
            );
        }
    }
    let _ = write!(
        out,
        "\nThe figures are those of `{}`, with depth if the log has it.\n",
        KNOWN.command
    );
    let default = default_network();
    let installed = installed_networks();
    let embeddings = installed_embeddings();
    let _ = if installed.is_empty() && embeddings.is_empty() {
        writeln!(out, "None is installed: `tagalong model --install FILE.onnx`.")
    } else {
        writeln!(out, "Installed (`tagalong model --remove NAME` removes one):")
    };
    for name in installed {
        let is_default = default.as_ref() == Some(&name);
        let mark = if is_default { " (taken for a log with colour alone)" } else { "" };
        let _ = writeln!(out, "  {name}{mark}");
    }
    for name in embeddings {
        let _ = writeln!(out, "  {name} (re-identification: [appearance] model = \"{name}\")");
    }
    out
}

/// Returns the known and the installed networks as JSON.
pub(super) fn as_json() -> Value {
    json!({
        "known": KNOWN.network,
        "command": KNOWN.command,
        "installed": installed_networks(),
        "embeddings": installed_embeddings(),
        "default": default_network(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_what_a_user_asks_for() {
        for network in &KNOWN.network {
            assert!(network.published.starts_with("https://"), "{}", network.name);
            assert_eq!(network.sha256.len(), 64, "{}", network.name);
            assert!(network.bytes > 0 && network.call_ms > 0.0, "{}", network.name);
            assert!(!network.result.is_empty(), "{}: no figures", network.name);
        }
        assert_eq!(known_by_hash(&KNOWN.network[0].sha256).unwrap().name, KNOWN.network[0].name);
        assert!(known_by_hash("").is_none());
    }
}
