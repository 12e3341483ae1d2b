//! Work of several threads.

use std::thread;

/// Returns the rows of a band of an image, of which there is one for each thread.
pub fn band_rows(height: usize, threads: usize) -> usize {
    height.div_ceil(threads).max(1)
}

/// Does all jobs at once, each on its own thread; the first on this one.
pub fn share<J: Send>(jobs: impl IntoIterator<Item = J>, work: impl Fn(J) + Sync) {
    thread::scope(|scope| {
        let (mut jobs, work) = (jobs.into_iter(), &work);
        let own = jobs.next();
        for job in jobs {
            scope.spawn(move || work(job));
        }
        own.map(work);
    });
}
