use std::any::Any;
use std::sync::Arc;

/// Picture of a plugin's inner state, made on request only. Its type is agreed between the plugin
/// and the program that shows it: core passes it on unseen. `tagalong-vision` has types that the
/// pictures of `tagalong run --overlay` show.
///
/// ```
/// # use std::sync::Arc;
/// # use tagalong_core::Visualisation;
/// struct Particles(Vec<[f64; 2]>);
///
/// let shown: Visualisation = Arc::new(Particles(vec![[320.0, 90.0]]));
/// assert_eq!(shown.downcast_ref::<Particles>().map(|particles| particles.0.len()), Some(1));
/// ```
pub type Visualisation = Arc<dyn Any + Send + Sync>;
