//! Messages about the permission to move, and about the publishers of the enable.

use tagalong::pipeline::Permission;

use super::CONTESTED;
use crate::Options;

/// Returns a message about what is missing for a permission; `enables` is the number of publishers
/// of the enable.
pub(super) fn remedy(permission: Permission, enables: usize, options: &Options) -> String {
    let Options { enable, reset, .. } = options;
    let needed = match permission {
        Permission::Granted => return String::new(),
        Permission::NotEnabled | Permission::Expired => {
            format!(": the robot stands until `true` comes on {enable}")
        }
        Permission::NeedsRelease => format!(
            ": `true` on {enable} has come since before the reset; the robot stands until it ceases, and \
             comes again"
        ),
        Permission::Latched(CONTESTED) => format!(
            ": the robot stands, because with several publishers of the enable none of them can \
             stop it; end all publishers on {enable} but one (`ros2 topic info --verbose` names \
             them), then send a message on {reset}, and begin to send `true` on {enable}"
        ),
        Permission::Latched(_) => format!(
            ": the robot stands until a message on {reset}, after which `true` begins on {enable}"
        ),
    };
    let unheard = nobody(permission, enables, enable).map(|words| format!("; {words}"));
    needed + &unheard.unwrap_or_default()
}

/// Returns a message that the robot cannot be enabled, because no publisher of the enable is
/// discovered.
pub(super) fn nobody(permission: Permission, enables: usize, enable: &str) -> Option<String> {
    (enables == 0 && !permission.is_granted()).then(|| format!("nobody publishes {enable}"))
}

/// Returns a message that publishers of the enable appeared or disappeared.
pub(super) fn change_of_publishers(before: usize, now: usize, enable: &str) -> Option<String> {
    match (before, now) {
        (0, 1..) => Some(format!("found a publisher of {enable}")),
        (1.., 0) => Some(format!(
            "the publisher of {enable} is gone: it has ended, or its announcements were lost on the network \
             (README, Lost announcements); until it is found again, no `true` of it counts"
        )),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options() -> Options {
        clap::Parser::parse_from(["tagalong-ros2", "follow-depth", "--enable", "hand"])
    }

    #[test]
    fn a_robot_that_nobody_can_enable_says_so() {
        let latched = Permission::Latched("needs a reset");
        for permission in [Permission::NotEnabled, Permission::Expired, latched] {
            let alone = remedy(permission, 0, &options());
            assert!(alone.ends_with("; nobody publishes hand"), "{alone}");
            let heard = remedy(permission, 1, &options());
            assert!(!heard.contains("nobody") && alone.starts_with(&heard), "{heard}");
        }
        assert_eq!(remedy(Permission::Granted, 0, &options()), "");
        assert_eq!(nobody(Permission::Granted, 0, "hand"), None);
    }

    #[test]
    fn a_publisher_of_the_enable_that_comes_or_goes_is_told_once() {
        for (before, now, words) in [
            (0, 0, None),
            (0, 1, Some("found")),
            (1, 1, None),
            (2, 1, None),
            (1, 0, Some("gone")),
            (2, 0, Some("gone")),
        ] {
            let told = change_of_publishers(before, now, "hand");
            let matches = match words {
                Some(words) => told.as_ref().is_some_and(|told| told.contains(words)),
                None => told.is_none(),
            };
            assert!(matches, "{before} {now}: {told:?}");
        }
    }
}
