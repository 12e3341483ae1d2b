use std::collections::BTreeSet;

use anyhow::{Context as _, Result};
use serde::Deserialize;
use spdx::{Expression, ParseMode};

use crate::metadata::{Metadata, Package};
use crate::workspace::Workspace;

/// The part of `deny.toml` that is read here, so that there is one list for
/// cargo-deny and for machines without it.
#[derive(Deserialize)]
struct Deny {
    licenses: Licences,
}

#[derive(Deserialize)]
struct Licences {
    allow: BTreeSet<String>,
}

/// Complains about dependencies whose licence the list in `deny.toml` does not satisfy.
pub fn check(workspace: &Workspace, metadata: &Metadata) -> Result<Vec<String>> {
    let deny: Deny = toml::from_str(&workspace.read("deny.toml")?)
        .context("deny.toml has no list of licences")?;
    let allow = &deny.licenses.allow;
    let mut complaints = BTreeSet::new();
    complaints.extend(metadata.outside().filter_map(|package| complaint(package, allow)));
    Ok(complaints.into_iter().collect())
}

fn complaint(package: &Package, allow: &BTreeSet<String>) -> Option<String> {
    let name = format!("{} {}", package.name, package.version);
    let Some(licence) = &package.license else {
        return Some(format!("{name} declares no licence"));
    };
    match satisfied(licence, allow) {
        Ok(true) => None,
        Ok(false) => Some(format!("{name} is `{licence}`, which deny.toml does not allow")),
        Err(error) => Some(format!("{name}: `{licence}` is no SPDX expression: {error}")),
    }
}

fn satisfied(licence: &str, allow: &BTreeSet<String>) -> Result<bool, spdx::ParseError> {
    let expression = Expression::parse_mode(licence, ParseMode::LAX)?;
    Ok(expression.evaluate(|part| allow.contains(&part.to_string())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expression_is_satisfied_by_what_is_allowed() {
        let allow = BTreeSet::from(["MIT", "Apache-2.0"].map(String::from));
        for (licence, is_allowed) in [
            ("MIT OR GPL-3.0-only", true),
            ("MIT/Apache-2.0", true),
            ("(MIT OR Apache-2.0) AND Apache-2.0", true),
            ("MIT AND GPL-3.0-only", false),
            ("Apache-2.0 WITH LLVM-exception", false),
        ] {
            assert_eq!(satisfied(licence, &allow).unwrap(), is_allowed, "{licence}");
        }
        assert!(satisfied("the usual", &allow).is_err());
    }
}
