//! Waits for submitted work: a native driver blocks the thread until its GPU is done, a browser calls back.

use super::{Device, one_line};
use crate::{GpuError, Result};

#[cfg(not(target_arch = "wasm32"))]
impl Device {
    /// Waits for the work submitted up to `submission`.
    pub(crate) fn wait(&self, submission: &wgpu::SubmissionIndex) -> Result<()> {
        self.check()?;
        let waited = self.inner.poll(wgpu::PollType::Wait {
            submission_index: Some(submission.clone()),
            timeout: Some(self.patience),
        });
        match waited {
            Ok(_) => {}
            Err(wgpu::PollError::Timeout) => {
                self.give_up(&format!("no answer for {:?}", self.patience));
            }
            Err(why) => self.give_up(&one_line(why)),
        }
        self.check()
    }

    /// Maps a readable buffer that `submission` writes. Blocks until the work is done.
    pub(crate) async fn map(&self, buffer: &wgpu::Buffer, submission: &wgpu::SubmissionIndex) -> Result<()> {
        let (send, receive) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |mapped| {
            // The receiver waits below or has given up.
            let _ = send.send(mapped);
        });
        self.wait(submission)?;
        // Another thread that polls the device may run the callback.
        match receive.recv_timeout(self.patience) {
            Ok(Ok(())) => Ok(()),
            Ok(Err(why)) => Err(GpuError::Lost(one_line(why))),
            Err(why) => Err(GpuError::Lost(one_line(why))),
        }
    }

    /// Checks whether variants are measured: not on a software driver, whose threads others use too.
    pub(crate) fn measures(&self) -> bool {
        !self.is_software()
    }
}

#[cfg(target_arch = "wasm32")]
impl Device {
    /// Refuses to wait, because a browser's thread must not block.
    pub(crate) fn wait(&self, _submission: &wgpu::SubmissionIndex) -> Result<()> {
        Err(GpuError::Refused(
            "a browser does not wait for its GPU, so nothing is measured".into(),
        ))
    }

    /// Maps a readable buffer that a submission writes, when the browser says that the work is done.
    pub(crate) async fn map(&self, buffer: &wgpu::Buffer, _submission: &wgpu::SubmissionIndex) -> Result<()> {
        use std::sync::{Arc, Mutex};
        use std::task::{Poll, Waker};

        self.check()?;
        let state = Arc::new(Mutex::new((None, None::<Waker>)));
        let told = state.clone();
        buffer.map_async(wgpu::MapMode::Read, .., move |mapped| {
            let (result, waker) = &mut *super::lock(&told);
            *result = Some(mapped);
            if let Some(waker) = waker.take() {
                waker.wake();
            }
        });
        let mapped = std::future::poll_fn(|context| {
            let (result, waker) = &mut *super::lock(&state);
            match result.take() {
                Some(mapped) => Poll::Ready(mapped),
                None => {
                    *waker = Some(context.waker().clone());
                    Poll::Pending
                }
            }
        });
        if let Err(why) = mapped.await {
            self.check()?;
            return Err(GpuError::Lost(one_line(why)));
        }
        Ok(())
    }

    /// Checks whether variants are measured: not in a browser, which does not wait and whose clock is coarse.
    pub(crate) fn measures(&self) -> bool {
        false
    }
}
