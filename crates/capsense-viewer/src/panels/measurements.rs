//! Measured curves beside the computed ones: recordings from files, and a board that is connected now.

use crate::history::{Overlay, TimeAxis};
use crate::live::{Connection, LiveSource};
use crate::measured::{Channel, Measured};
use crate::palette::palette;
use crate::session::Session;
use crate::style::{chip, error_colour, faint, named, row};
use capsense::core::capacitance::upper_triangle;
use capsense::series::Curve;
use capsense_hw::profile::{DeviceProfile, built_in_names};
use egui::{ComboBox, DragValue, RichText, TextEdit, Ui};
use std::path::{Path, PathBuf};

/// A connected board and what it sent.
struct Live {
    source: LiveSource,
    /// When the connection began, in seconds of the session.
    begun_s: f64,
    channels: Vec<Channel>,
    is_farads: bool,
}

/// What is asked for before connecting.
struct Form {
    port: String,
    baud: u32,
    device: String,
    records: bool,
    recording: String,
    /// Ports that were found when the list was last opened.
    ports: Vec<String>,
    error: Option<String>,
}

impl Default for Form {
    fn default() -> Self {
        Self {
            port: String::new(),
            baud: 115_200,
            device: "generic".to_owned(),
            records: false,
            recording: "recording.mcap".to_owned(),
            ports: Vec::new(),
            error: None,
        }
    }
}

/// All that is measured.
#[derive(Default)]
pub struct Measurements {
    recordings: Vec<Measured>,
    live: Option<Live>,
    form: Form,
}

impl Measurements {
    /// Opens a recording beside the curves.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn open(&mut self, path: &Path, session: &Session) -> Result<(), String> {
        let electrodes = session.history.electrodes().to_vec();
        self.recordings.push(Measured::load(path, &electrodes)?);
        Ok(())
    }

    /// Connects a board.
    ///
    /// # Errors
    /// When the port cannot be opened, or the recording not created.
    pub fn connect(
        &mut self,
        connection: Connection,
        session: &Session,
        wake: impl Fn() + Send + 'static,
    ) -> Result<(), String> {
        let is_farads = connection.profile.meaning != capsense_hw::profile::Meaning::Counts;
        let source = LiveSource::connect(connection, wake)?;
        self.live = Some(Live { source, begun_s: session.now_s(), channels: Vec::new(), is_farads });
        Ok(())
    }

    /// Disconnects the board and completes its recording; what it sent stays on display as a recording.
    pub fn disconnect(&mut self) {
        self.live = None;
    }

    /// Channels of the connected board.
    pub fn live_channels(&mut self) -> &mut [Channel] {
        self.live.as_mut().map_or(&mut [], |live| &mut live.channels)
    }

    /// Takes what the board has sent.
    pub fn update(&mut self, session: &Session) {
        let Some(live) = &mut self.live else { return };
        let electrodes = session.history.electrodes().len();
        for (time_s, values) in live.source.take() {
            while live.channels.len() < values.len() {
                let index = live.channels.len();
                let electrode = index.min(electrodes.saturating_sub(1));
                // A board that sends the whole upper triangle is that of `capsense device`.
                let is_triangle = values.len() == electrodes * (electrodes + 1) / 2;
                let entry = match is_triangle {
                    true => index,
                    false => crate::measured::entry_of(electrode, electrode, electrodes.max(1)),
                };
                live.channels.push(Channel::new(format!("C{}", index + 1), live.is_farads, entry));
            }
            for (channel, value) in live.channels.iter_mut().zip(values) {
                if let Some(value) = value {
                    channel.push(live.begun_s + time_s, value);
                }
            }
        }
    }

    /// What is drawn over a time axis: recordings over the trajectories', the board over the session's.
    pub fn overlays(&self, axis: TimeAxis) -> Vec<Overlay> {
        let shown = |name: &str, channels: &[Channel], lag_s: f64| -> Vec<Overlay> {
            let shown = channels.iter().filter(|channel| channel.is_shown);
            let overlay = |channel: &Channel| Overlay {
                name: format!("{name} {}", channel.name),
                entry: channel.entry,
                points: channel.points(lag_s),
            };
            shown.map(overlay).collect()
        };
        match axis {
            TimeAxis::Scene => {
                self.recordings.iter().flat_map(|m| shown(&m.name, &m.channels, m.lag_s)).collect()
            }
            TimeAxis::Session => {
                self.live.iter().flat_map(|live| shown("board", &live.channels, 0.0)).collect()
            }
        }
    }

    /// Time of the last sample of the connected board, in seconds of the session.
    pub fn last_s(&self) -> Option<f64> {
        let channels = self.live.as_ref()?.channels.iter();
        channels.filter_map(|channel| channel.times.last().copied()).reduce(f64::max)
    }

    /// Draws recordings.
    pub fn recordings_ui(&mut self, ui: &mut Ui, session: &Session) -> bool {
        let mut gone = None;
        for (index, measured) in self.recordings.iter_mut().enumerate() {
            ui.horizontal(|ui| {
                ui.label(&measured.name);
                if ui.small_button("×").on_hover_text("close the recording").clicked() {
                    gone = Some(index);
                }
            });
            let span = session.transport.end_s().max(1.0);
            row(ui, "lag", |ui| {
                ui.spacing_mut().slider_width = 70.0;
                let slider =
                    egui::Slider::new(&mut measured.lag_s, -span..=span).suffix(" s").max_decimals(3);
                named(ui.add(slider), "lag").on_hover_text("added to the times of the recording");
                let hint = "the lag at which the first channel that is shown is most like its curve";
                if ui.small_button("best").on_hover_text(hint).clicked() {
                    let shown = measured.channels.iter().find(|channel| channel.is_shown);
                    let best = shown.and_then(|channel| {
                        let curve = computed_curve(session, TimeAxis::Scene, channel, measured.lag_s)?;
                        channel.best_lag(&curve, measured.lag_s)
                    });
                    measured.lag_s = best.unwrap_or(measured.lag_s).clamp(-span, span);
                }
            });
            let lag_s = measured.lag_s;
            ui.push_id(index, |ui| channels(ui, &mut measured.channels, session, TimeAxis::Scene, lag_s));
            ui.separator();
        }
        if let Some(index) = gone {
            self.recordings.remove(index);
        }
        if self.recordings.is_empty() {
            ui.label(RichText::new("None is open. Drop a .csv or .mcap file.").color(faint(ui)).small());
        }
        ui.button("open a recording…").clicked()
    }

    /// Draws the connection and what comes from it.
    pub fn hardware_ui(&mut self, ui: &mut Ui, session: &Session) {
        if self.live.is_some() {
            self.connected(ui, session);
        } else {
            self.form(ui, session);
        }
        if let Some(error) = &self.form.error {
            ui.label(RichText::new(error).color(error_colour(ui)));
        }
    }

    fn form(&mut self, ui: &mut Ui, session: &Session) {
        let form = &mut self.form;
        row(ui, "port", |ui| {
            let edit = TextEdit::singleline(&mut form.port).desired_width(110.0).hint_text("/dev/ttyACM0");
            named(ui.add(edit), "port");
            ui.menu_button("…", |ui| {
                if ui.button("look again").clicked() || form.ports.is_empty() {
                    let found = capsense_hw::list_ports().unwrap_or_default();
                    form.ports = found.into_iter().map(|port| port.name).collect();
                }
                if form.ports.is_empty() {
                    ui.label(RichText::new("no serial ports").color(faint(ui)));
                }
                for port in form.ports.clone() {
                    if ui.button(&port).clicked() {
                        form.port = port;
                        ui.close();
                    }
                }
            });
        });
        row(ui, "board", |ui| {
            let list = ComboBox::from_id_salt("device").selected_text(form.device.clone()).width(130.0);
            let list = list.show_ui(ui, |ui| {
                for name in built_in_names() {
                    ui.selectable_value(&mut form.device, name.to_owned(), name);
                }
            });
            named(list.response, "board");
        });
        row(ui, "speed", |ui| {
            named(ui.add(DragValue::new(&mut form.baud).range(300..=12_000_000).suffix(" baud")), "speed");
        });
        row(ui, "record", |ui| {
            named(ui.checkbox(&mut form.records, ""), "record");
            let edit = TextEdit::singleline(&mut form.recording).desired_width(120.0);
            named(ui.add_enabled(form.records, edit), "recording");
        });
        let is_given = !form.port.trim().is_empty();
        if ui.add_enabled(is_given, egui::Button::new("connect")).clicked() {
            let connection =
                DeviceProfile::find(&form.device).map_err(|error| error.to_string()).map(|profile| {
                    let record = form.records.then(|| PathBuf::from(form.recording.trim()));
                    Connection { port: form.port.trim().to_owned(), baud: form.baud, profile, record }
                });
            let ctx = ui.ctx().clone();
            let result = connection.and_then(|c| self.connect(c, session, move || ctx.request_repaint()));
            self.form.error = result.err();
        }
    }

    fn connected(&mut self, ui: &mut Ui, session: &Session) {
        let Some(live) = &mut self.live else { return };
        let counters = live.source.counters();
        let seconds = counters.time.as_secs_f64();
        let rate = counters.samples as f64 / seconds.max(1e-3);
        let state = if live.source.is_connected() { "connected" } else { "waiting for the port" };
        row(ui, &self.form.port, |ui| ui.label(state));
        row(ui, "samples", |ui| ui.label(format!("{} ({rate:.1} per second)", counters.samples)));
        if counters.passed_over + counters.dropped + counters.missing > 0 {
            row(ui, "lost", |ui| {
                let (bytes, samples) = (counters.passed_over + counters.dropped, counters.missing);
                ui.label(format!("{bytes} bytes, {samples} samples"));
            });
        }
        if let Some(error) = live.source.error() {
            ui.label(RichText::new(error).color(error_colour(ui)));
        }
        ui.push_id("live", |ui| channels(ui, &mut live.channels, session, TimeAxis::Session, 0.0));
        let text = if self.form.records { "disconnect and complete the recording" } else { "disconnect" };
        if ui.button(text).clicked() {
            self.disconnect();
        }
    }
}

/// What was computed of a channel's entry. Over the session only what is as old as the measurement counts, so that few samples
/// are compared.
fn computed_curve(session: &Session, axis: TimeAxis, channel: &Channel, lag_s: f64) -> Option<Curve> {
    let first = channel.times.first().map_or(f64::INFINITY, |time| time + lag_s) - 1.0;
    let samples = session.history.samples(axis).into_iter();
    let known = samples.filter(|sample| sample.time_s >= first && channel.entry < sample.farads.len());
    let (times, values) = known.map(|sample| (sample.time_s, sample.farads[channel.entry])).unzip();
    Curve::new(times, values).ok()
}

/// One row a channel: whether it is drawn, what it is compared with, how alike they are, and the calibration.
fn channels(ui: &mut Ui, channels: &mut [Channel], session: &Session, axis: TimeAxis, lag_s: f64) {
    let electrodes = session.history.electrodes();
    let names: Vec<String> = upper_triangle(electrodes.len())
        .map(|(a, b)| format!("{}–{}", electrodes[a], electrodes[b]))
        .collect();
    for (index, channel) in channels.iter_mut().enumerate() {
        let computed = computed_curve(session, axis, channel, lag_s);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 6.0;
            chip(ui, &mut channel.is_shown, palette(channel.entry), &channel.name, "");
            let shown = names.get(channel.entry).map_or("", String::as_str);
            let list = ComboBox::from_id_salt(("entry", index)).selected_text(shown).width(74.0);
            let list = list.show_ui(ui, |ui| {
                for (entry, name) in names.iter().enumerate() {
                    ui.selectable_value(&mut channel.entry, entry, name);
                }
            });
            named(list.response, "compared with");
            let r = computed.as_ref().and_then(|computed| channel.pearson(computed, lag_s));
            let text = r.map_or_else(|| "r –".to_owned(), |r| format!("r {r:.4}"));
            ui.monospace(text).on_hover_text("Pearson's correlation with the computed curve");
        });
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 6.0;
            ui.add_space(10.0);
            let can = computed.is_some();
            let fit = ui.add_enabled(can, egui::Button::new("calibrate").small());
            let align = ui.add_enabled(can, egui::Button::new("offset").small());
            if let Some(computed) = &computed {
                if fit.on_hover_text("gain and offset that bring it nearest to the computed curve").clicked()
                {
                    channel.calibrate(computed, lag_s);
                }
                if align.on_hover_text("the offset alone, so that the means agree").clicked() {
                    channel.align(computed, lag_s);
                }
            }
            let unit = if channel.is_farads { "" } else { " fF a count" };
            let gain = if channel.is_farads { channel.gain } else { channel.gain * 1e15 };
            let text = format!("× {gain:.4}{unit}, {:+.3} pF", channel.offset * 1e12);
            ui.label(RichText::new(text).color(faint(ui)).small());
        });
    }
}
