//! The board for `farnear.rig.Rig`: Ctrl-C interrupts each call and stops all motion.

use std::{collections::BTreeMap, process, sync::Arc, time::Duration};

use farnear_capture::{
    Client,
    camera::Image,
    describe::{alarm_text, state_name, um},
    expose::{CaptureError, expose_in_parts, sensor_mm},
    pair::{Exposures, capture_pair},
    plan::SensorPair,
    ready::{ensure_homed, steppers},
    sequence::{ShotDefaults, nanometres},
};
use farnear_protocol::{
    Micros, Nanometres,
    message::{Axis, AxisStatus, LightLevels, Limits, ShotRecord},
};
use farnear_workflows::rig::{
    camera::{CameraAddress, light_of_percent},
    pair::AVERAGED_MAX,
};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::{prelude::*, types::PyDict};

use crate::{
    errors::{FarnearError, RigError, rig, wrong},
    optics::Optics,
    work,
};

/// An image (height, width), its bit depth, and its record.
type Taken<'py> = (Bound<'py, PyArray2<u16>>, u8, Bound<'py, PyDict>);

/// A board on a serial port, connected.
#[pyclass(module = "farnear._farnear")]
pub struct RigClient {
    /// `None` while it is dropped.
    client: Option<Client>,
    /// The process that has the port's thread. A child by `os.fork` does not.
    opened_by: u32,
}

impl Drop for RigClient {
    fn drop(&mut self) {
        if self.opened_by != process::id() {
            // Dropping a client joins the port's thread, which would never return here.
            std::mem::forget(self.client.take());
        }
    }
}

#[pymethods]
impl RigClient {
    #[new]
    fn new(py: Python<'_>, port: &str) -> PyResult<Self> {
        let port = port.to_owned();
        let client = work::watched(py, move || Client::open(&port))?.map_err(rig)?;
        Ok(Self { client: Some(client), opened_by: process::id() })
    }

    /// Homes axes at the same time, all that have a home switch where none are named; gives their encoders' shifts in um.
    #[pyo3(signature = (axes=None))]
    fn home(&self, py: Python<'_>, axes: Option<Vec<String>>) -> PyResult<BTreeMap<&'static str, f64>> {
        let axes = match axes {
            Some(names) => names.iter().map(|name| axis(name)).collect::<PyResult<Vec<_>>>()?,
            None => steppers(&self.client()?.hello().capabilities),
        };
        self.interruptibly(py, |client| {
            let started = axes.iter().zip(client.start_homing(&axes)?);
            started.map(|(axis, work)| Ok((axis.name(), um(work.homed()?)))).collect()
        })
    }

    /// Homes what is not homed.
    fn ensure_homed(&self, py: Python<'_>) -> PyResult<()> {
        self.interruptibly(py, |client| Ok(ensure_homed(client, &mut |_| {})?))
    }

    /// Moves axes at the same time, um; gives where they have come to, um.
    fn move_to(
        &self,
        py: Python<'_>,
        targets_um: BTreeMap<String, f64>,
    ) -> PyResult<BTreeMap<&'static str, f64>> {
        let targets = targets_um.iter().map(|(name, to_um)| Ok((axis(name)?, position(*to_um)?)));
        let targets = targets.collect::<PyResult<Vec<_>>>()?;
        self.interruptibly(py, |client| {
            let started = targets.iter().zip(client.start_moves(&targets)?);
            started.map(|((axis, _), work)| Ok((axis.name(), um(work.moved()?.measured)))).collect()
        })
    }

    /// What the board says of itself now.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let status = self.interruptibly(py, |client| Ok(client.status()?))?;
        let dict = PyDict::new(py);
        for (name, axis) in [("coarse", &status.coarse), ("fine", &status.fine), ("lens", &status.lens)] {
            dict.set_item(name, of_axis(py, axis)?)?;
        }
        dict.set_item("emergency_stop", status.emergency_stop)?;
        dict.set_item("alarm", status.alarm.map(|record| record.number))?;
        dict.set_item("alarm_text", status.alarm.map(|record| alarm_text(record.alarm)))?;
        Ok(dict)
    }

    /// Who the board is and how far it goes.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let hello = self.client()?.hello();
        let limits = hello.limits;
        let dict = PyDict::new(py);
        dict.set_item("board", hello.board.as_str())?;
        dict.set_item("firmware", hello.firmware.as_str())?;
        dict.set_item("emulated", hello.emulated)?;
        dict.set_item("shots_max", limits.shots_max)?;
        let ms = |exposure: Micros| f64::from(exposure.0) / 1e3;
        dict.set_item("exposure_ms", (ms(limits.exposure_min), ms(limits.exposure_max)))?;
        for (name, min, max) in [
            ("coarse_um", limits.coarse_min, limits.coarse_max),
            ("fine_um", limits.fine_min, limits.fine_max),
            ("lens_um", limits.lens_min, limits.lens_max),
        ] {
            dict.set_item(name, (um(min), um(max)))?;
        }
        Ok(dict)
    }

    /// Stops all motion along the ramps.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        let client = self.client()?;
        py.detach(|| client.stop()).map_err(rig)
    }

    /// Emergency stop; raises an alarm.
    fn halt(&self, py: Python<'_>) -> PyResult<()> {
        let client = self.client()?;
        py.detach(|| client.halt()).map_err(rig)
    }

    /// Clears an alarm by its number.
    fn clear_alarm(&self, py: Python<'_>, number: u32) -> PyResult<()> {
        let client = self.client()?;
        py.detach(|| client.clear_alarm(number)).map_err(rig)
    }

    /// Runs programs of positions (axis, um) on the board; gives an image with its record for each.
    #[pyo3(signature = (camera, shots, *, exposure_us=5000, wait_s=30.0, light=None))]
    fn expose<'py>(
        &self,
        py: Python<'py>,
        camera: &str,
        shots: Vec<(String, f64)>,
        exposure_us: u32,
        wait_s: f64,
        light: Option<[f64; 2]>,
    ) -> PyResult<Vec<Taken<'py>>> {
        let (address, wait) = (address(camera)?, waiting(wait_s)?);
        let light = levels(light)?;
        let usual = ShotDefaults { exposure: Micros(exposure_us), ..ShotDefaults::default() };
        let shots = shots.iter().map(|(name, to_um)| Ok(usual.shot(axis(name)?, position(*to_um)?)));
        let shots = shots.collect::<PyResult<Vec<_>>>()?;
        let limits = self.client()?.hello().limits;
        let taken = self.interruptibly(py, |client| {
            let mut camera = open(&address)?;
            let mut client = client.clone();
            client.set_light(light);
            let mut taken = Vec::with_capacity(shots.len());
            let on_image = |_, record, image: Image| -> Result<(), CaptureError> {
                taken.push((image.pixels, image.bits, record));
                Ok(())
            };
            expose_in_parts(&client, camera.as_mut(), &shots, wait, on_image)?;
            Ok(taken)
        })?;
        taken.into_iter().map(|taken| of_image(py, taken, &limits)).collect()
    }

    /// A far- and a near-focused image for some optics: homes where needed, brings the stage near, exposes both by piezo.
    #[pyo3(signature = (camera, optics, *, exposure_us=5000, wait_s=30.0, light=None, subtract_ambient=false, average=1, auto_exposure=false))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn capture_pair<'py>(
        &self,
        py: Python<'py>,
        camera: &str,
        optics: &Optics,
        exposure_us: u32,
        wait_s: f64,
        light: Option<[f64; 2]>,
        subtract_ambient: bool,
        average: u16,
        auto_exposure: bool,
    ) -> PyResult<(Taken<'py>, Taken<'py>)> {
        let light = levels(light)?;
        if subtract_ambient && light.is_none() {
            return Err(FarnearError::new_err("subtract_ambient needs light=(first, second) in percent"));
        }
        if !(1..=AVERAGED_MAX).contains(&average) {
            return Err(FarnearError::new_err(format!("average = {average}: expected 1 to {AVERAGED_MAX}")));
        }
        let (address, image_wait) = (address(camera)?, waiting(wait_s)?);
        let range = optics.0.working_range();
        let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
        let exposures = Exposures {
            exposure: Micros(exposure_us),
            image_wait,
            averaged: average,
            auto: auto_exposure,
            subtract_ambient,
            ..Exposures::default()
        };
        let limits = self.client()?.hello().limits;
        let pair = self.interruptibly(py, |client| {
            let mut camera = open(&address)?;
            let mut client = client.clone();
            client.set_light(light);
            Ok(capture_pair(&client, camera.as_mut(), &sensor, &exposures, &mut |_| {})?)
        })?;
        let [far, near] = [pair.far, pair.near]
            .map(|taken| of_image(py, (taken.image.pixels, taken.image.bits, taken.record), &limits));
        Ok((far?, near?))
    }
}

struct Failed(String);

impl<E: std::error::Error> From<E> for Failed {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

impl RigClient {
    fn client(&self) -> PyResult<&Client> {
        let here = process::id();
        self.client.as_ref().filter(|_| self.opened_by == here).ok_or_else(|| {
            RigError::new_err(format!(
                "this rig was opened by another process ({}, this one is {here}), and its connection does not survive fork: use it \
                 there, or open the rig after the fork",
                self.opened_by
            ))
        })
    }

    /// Runs `work` in a thread and polls for interruptions; an interruption first stops the rig.
    fn interruptibly<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Client) -> Result<T, Failed> + Send,
    ) -> PyResult<T> {
        let mut client = self.client()?.clone();
        let done = work::interruptibly(py, move |stop| {
            client.interrupt_by(Arc::clone(stop));
            work(&client)
        })?;
        done.map_err(|Failed(message)| RigError::new_err(message))
    }
}

fn axis(name: &str) -> PyResult<Axis> {
    let known = [Axis::SensorCoarse, Axis::SensorFine, Axis::Lens];
    known.into_iter().find(|axis| axis.name() == name).ok_or_else(|| {
        FarnearError::new_err(format!("there is no axis {name:?}; expected coarse, fine or lens"))
    })
}

fn position(to_um: f64) -> PyResult<Nanometres> {
    nanometres(to_um).ok_or_else(|| {
        FarnearError::new_err(format!("{to_um} um is out of range; expected -2147483 to 2147483 um"))
    })
}

fn waiting(wait_s: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(wait_s)
        .map_err(|error| FarnearError::new_err(format!("wait_s = {wait_s}: {error}")))
}

fn address(camera: &str) -> PyResult<CameraAddress> {
    match camera.parse().map_err(wrong)? {
        CameraAddress::Emulated => Err(FarnearError::new_err(
            "the camera \"sim\" has no address; farnear.rig.EmulatedRig knows that of its camera",
        )),
        address => Ok(address),
    }
}

fn levels(percent: Option<[f64; 2]>) -> PyResult<Option<LightLevels>> {
    percent
        .map(light_of_percent)
        .transpose()
        .map_err(|reason| FarnearError::new_err(format!("light: {reason}")))
}

fn open(address: &CameraAddress) -> Result<Box<dyn farnear_capture::camera::Camera>, Failed> {
    let camera = address.open()?.ok_or_else(|| Failed("no camera was named".into()))?;
    Ok(camera)
}

fn of_axis<'py>(py: Python<'py>, status: &AxisStatus) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("state", state_name(status.state))?;
    dict.set_item("asked_um", um(status.asked))?;
    dict.set_item("measured_um", um(status.measured))?;
    dict.set_item("moving", status.moving)?;
    Ok(dict)
}

fn of_image<'py>(
    py: Python<'py>,
    (pixels, bits, record): (Array2<u16>, u8, ShotRecord),
    limits: &Limits,
) -> PyResult<Taken<'py>> {
    let dict = PyDict::new(py);
    dict.set_item("axis", record.axis.name())?;
    dict.set_item("asked_um", um(record.asked))?;
    dict.set_item("measured_um", um(record.measured(record.axis)))?;
    dict.set_item("sensor_mm", sensor_mm(&record, limits))?;
    dict.set_item("settle_ms", f64::from(record.settle.0) / 1e3)?;
    dict.set_item("strobe_start_us", record.strobe_start.0)?;
    dict.set_item("strobe_end_us", record.strobe_end.0)?;
    dict.set_item("exposure_us", record.exposure.0)?;
    Ok((pixels.into_pyarray(py), bits, dict))
}
