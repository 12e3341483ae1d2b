//! A network in a separate thread, so that a call can be abandoned.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::{Network, Tensor};

type Answer = Result<Vec<Tensor>, String>;

/// Thread that runs a network, one call after the other.
pub(crate) struct Worker {
    jobs: SyncSender<Vec<Tensor>>,
    answers: Receiver<Answer>,
    /// True while the answer of an abandoned call is outstanding.
    late: bool,
}

impl Worker {
    /// Starts a thread that creates a network with `load` and then waits for calls. The second
    /// value is the one that `about` returns for the network.
    ///
    /// # Errors
    /// Those of `load` and `about`; a panic in them; no answer within `deadline`.
    pub(crate) fn start<N: Network, T: Send + 'static>(
        load: impl FnOnce() -> Result<N, String> + Send + 'static,
        about: impl FnOnce(&mut N) -> Result<T, String> + Send + 'static,
        deadline: Duration,
    ) -> Result<(Self, T), String> {
        let (jobs, queue) = sync_channel::<Vec<Tensor>>(1);
        let (done, answers) = sync_channel::<Answer>(1);
        let (ready, loaded) = sync_channel(1);
        let named = thread::Builder::new().name("network".into());
        let started = named.spawn(move || {
            let mut network = match load() {
                Ok(network) => network,
                Err(why) => return drop(ready.send(Err(why))),
            };
            let told = about(&mut network);
            let failed = told.is_err();
            if ready.send(told).is_err() || failed {
                return;
            }
            while let Ok(inputs) = queue.recv() {
                // If the receiver is gone, the answer is not needed any more.
                if done.send(network.run(&inputs)).is_err() {
                    return;
                }
            }
        });
        started.map_err(|why| format!("no thread for it can be started: {why}"))?;
        let told = loaded.recv_timeout(deadline).map_err(|why| match why {
            RecvTimeoutError::Timeout => {
                format!("it was not read and run once within {} s", deadline.as_secs_f64())
            }
            RecvTimeoutError::Disconnected => broken(),
        })??;
        Ok((Self { jobs, answers, late: false }, told))
    }

    /// Runs the network; `None` if this call, or an earlier one, does not finish within `deadline`.
    ///
    /// # Errors
    /// Those of [`Network::run`], and a panic of the runtime.
    pub(crate) fn run(
        &mut self,
        inputs: Vec<Tensor>,
        deadline: Duration,
    ) -> Result<Option<Vec<Tensor>>, String> {
        if self.late {
            match self.answers.try_recv() {
                Ok(_) => self.late = false,
                Err(TryRecvError::Empty) => return Ok(None),
                Err(TryRecvError::Disconnected) => return Err(broken()),
            }
        }
        let begun = Instant::now();
        self.jobs.send(inputs).map_err(|_| broken())?;
        match self.answers.recv_timeout(deadline) {
            // An answer that is there in time counts, however late this thread was woken.
            Ok(answer) if begun.elapsed() <= deadline => answer.map(Some),
            Ok(_) => Ok(None),
            Err(RecvTimeoutError::Timeout) => {
                self.late = true;
                Ok(None)
            }
            Err(RecvTimeoutError::Disconnected) => Err(broken()),
        }
    }
}

fn broken() -> String {
    "the runtime failed on it: export it again, for opset 17 and with fixed sizes".into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Port;

    /// Sleeps for as many milliseconds as its input says; panics at a negative number.
    struct Sleeper;

    impl Network for Sleeper {
        fn inputs(&self) -> &[Port] {
            &[]
        }

        fn outputs(&self) -> &[Port] {
            &[]
        }

        fn run(&mut self, inputs: &[Tensor]) -> Answer {
            let ms = inputs[0].values()[0];
            assert!(ms >= 0.0, "a negative number");
            thread::sleep(Duration::from_millis(ms as u64));
            Ok(inputs.to_vec())
        }
    }

    fn worker() -> Worker {
        Worker::start(|| Ok(Sleeper), |_| Ok(()), Duration::from_secs(5)).unwrap().0
    }

    fn call(worker: &mut Worker, ms: f32, within_ms: u64) -> Result<Option<f32>, String> {
        let input = Tensor::new(vec![1], vec![ms]).unwrap();
        let answer = worker.run(vec![input], Duration::from_millis(within_ms))?;
        Ok(answer.map(|outputs| outputs[0].values()[0]))
    }

    #[test]
    fn a_late_call_is_given_up_and_its_answer_is_never_that_of_another() {
        let mut worker = worker();
        assert_eq!(call(&mut worker, 0.0, 5000), Ok(Some(0.0)));
        assert_eq!(call(&mut worker, 300.0, 1), Ok(None));
        assert_eq!(call(&mut worker, 1.0, 5000), Ok(None), "the thread is busy");
        thread::sleep(Duration::from_millis(1000));
        assert_eq!(call(&mut worker, 2.0, 5000), Ok(Some(2.0)));
    }

    #[test]
    fn an_answer_after_the_deadline_is_none_and_the_thread_is_free_again() {
        let mut worker = worker();
        for _ in 0..100 {
            assert_eq!(call(&mut worker, 0.0, 0), Ok(None));
        }
        thread::sleep(Duration::from_millis(500));
        assert_eq!(call(&mut worker, 3.0, 5000), Ok(Some(3.0)));
    }

    #[test]
    fn a_panic_is_an_error() {
        let mut worker = worker();
        assert!(call(&mut worker, -1.0, 5000).unwrap_err().contains("the runtime failed"));
        assert!(call(&mut worker, 1.0, 5000).is_err());
    }

    #[test]
    fn a_network_that_cannot_be_made_is_an_error() {
        /// Returns the error of a network that this cannot load.
        fn refusal_of(load: fn() -> Result<Sleeper, String>, within_s: u64) -> String {
            let started = Worker::start(load, |_| Ok(()), Duration::from_secs(within_s));
            started.err().expect("it cannot be made")
        }

        assert_eq!(refusal_of(|| Err("no, never".into()), 60), "no, never");
        let failed = refusal_of(|| panic!("while loading"), 60);
        assert!(failed.contains("the runtime failed"), "{failed}");
        let slow = refusal_of(
            || {
                thread::sleep(Duration::from_secs(3));
                Ok(Sleeper)
            },
            1,
        );
        assert!(slow.contains("within 1 s"), "{slow}");
    }
}
