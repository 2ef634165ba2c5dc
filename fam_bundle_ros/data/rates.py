# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Smoothed rate and direction of sampled strain and pressure.

A local quadratic (Savitzky-Golay) per trial that also takes uneven time steps. The window is the
widest that the data bear: it grows until the rate is clean enough or the fit starts to miss the
strain's own bends, in the whole log and at each sample.
"""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import maximum_filter1d
from scipy.special import ndtri

WINDOWS = (5, 7, 9, 13, 19, 27, 39, 55)
#: A time step longer than so many usual steps is a pause of the log.
PAUSE_STEPS = WINDOWS[-1]
#: Probability, per log, that noise alone is reported as a corner, an offset, a stuck force.
FALSE_ALARM = 0.001
#: Probability that two samples of one distribution are taken for different ones.
BY_CHANCE = 0.01
#: Changes from sample to sample below which a signal's steps are not those of its reading.
_CHANGES = 16
#: Fewest third differences of a signal that goes on one way, and how many times smaller their
#: noise is where others are no noise: in white noise that turns at three places in four it is 2.
_ONWARD, _TURNS = 6, 3.0
#: Rows that are fitted at a time.
_BLOCK = 20_000
#: Slower motion than this share of the fast motion (90th percentile) counts as rest.
CRAWL = 0.02
#: Share of the largest pressure that no sensor tells from rest, or from a vented muscle.
REST_PRESSURE = 0.01
#: Median absolute deviation to standard deviation, of normal noise.
ROBUST = 1.4826


class _Local(NamedTuple):
    """A quadratic fitted about each sample, and one whose slope changes there, (T,) each."""

    #: Of the quadratic, at the sample.
    value: np.ndarray
    slope: np.ndarray
    #: Standard deviation of the slope where that of the samples is 1; larger where the window
    #: is cut, at the ends up to eleven times.
    slope_sd: np.ndarray
    #: By how much the slope changes, and its standard deviation where that of the samples
    #: is 1; 0 and infinite where the window is cut.
    bend: np.ndarray
    bend_sd: np.ndarray
    #: Standard deviation of the samples from the fit with the change.
    missed: np.ndarray


class Corners(NamedTuple):
    """Sudden changes of the slope of a signal, all (T,)."""

    #: The signal that the changes alone would make, and its slope, from zero at the first row.
    ramp: np.ndarray
    slope: np.ndarray
    #: Change of the slope at each sample, 0 for none, and whether it comes before the sample.
    bend: np.ndarray
    passed: np.ndarray
    #: Error of the slope by that of the changes within the window.
    error: np.ndarray

    def given_back(self, smooth: np.ndarray) -> np.ndarray:
        """Return the slope of the signal, (T,), by the smoothed slope of the rest without them."""
        before = self.slope + smooth
        turns = before * (before + self.bend) < 0.0
        rate = np.where(turns, 0.0, before + np.where(self.passed, self.bend, 0.0))
        return np.where(np.abs(rate) < 3.0 * self.error, 0.0, rate)


def _local(time: np.ndarray, value: np.ndarray, half: int) -> _Local:
    """Fit ``2 half + 1`` neighbours of each sample; at the ends the window is cut short."""
    rows = len(time)
    none = np.zeros(rows), np.full(rows, np.inf), np.full(rows, np.inf)
    if rows < 3:
        apart = np.ptp(time)
        return _Local(value, np.gradient(value, time) if rows == 2 else np.zeros(rows),
                      np.full(rows, np.sqrt(2.0) / apart if rows == 2 else 0.0), *none)
    here, t, y = (sliding_window_view(np.pad(column, half), 2 * half + 1)
                  for column in (np.ones(rows), time, value))
    scale = half * np.median(np.diff(time))
    t, y = (t - time[:, None]) * here / scale, (y - value[:, None]) * here
    square, after = t ** 2, slice(half + 1, None)

    def total(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.einsum('tw,tw->t', a, b)

    s1, s2, s3, s4 = t.sum(1), square.sum(1), total(t, square), total(square, square)
    normal = np.stack([[here.sum(1), s1, s2], [s1, s2, s3], [s2, s3, s4]]).transpose(2, 0, 1)
    normal[:, 2, 2] += 1e-12
    # the signal, and the ramp that begins at the sample, in terms of the quadratic
    signal = np.stack([y.sum(1), total(t, y), total(square, y)], -1)
    ramp = np.stack([t[:, after].sum(1), square[:, after].sum(1),
                     total(t[:, after], square[:, after])], -1)
    inverse = np.linalg.inv(normal)
    of_signal, of_ramp = (np.einsum('tij,tj->ti', inverse, each) for each in (signal, ramp))
    fitted = (value + of_signal[:, 0], of_signal[:, 1] / scale,
              np.sqrt(inverse[:, 1, 1]) / scale)
    if rows <= 2 * half:
        return _Local(*fitted, *none)
    whole = slice(half, rows - half)
    # residual of the ramp after the quadratic, and of the signal along it (Frisch, Waugh 1933)
    left = (ramp[:, 1] - np.sum(ramp * of_ramp, 1))[whole]
    bend, sd, missed = none
    bend[whole] = (total(t[:, after], y[:, after]) - np.sum(ramp * of_signal, 1))[whole] / left
    square_missed = (total(y, y) - np.sum(signal * of_signal, 1))[whole] - bend[whole] ** 2 * left
    sd[whole] = 1.0 / np.sqrt(left)
    missed[whole] = np.sqrt(np.maximum(square_missed, 0.0) / (2 * half - 3))
    return _Local(*fitted, bend / scale, sd / scale, missed)


def locally(time: np.ndarray, value: np.ndarray, parts: list[np.ndarray], half: int) -> _Local:
    """Return `_local` of each part, blocks of rows at a time to spare memory."""
    pieces = []
    for rows in parts:
        t, y = time[rows], value[rows]
        for begin in range(0, len(rows), _BLOCK):
            low, end = max(begin - half, 0), min(begin + _BLOCK, len(rows))
            found = _local(t[low:end + half], y[low:end + half], half)
            pieces.append([column[begin - low:end - low] for column in found])
    return _Local(*(np.concatenate(columns) for columns in zip(*pieces)))


def begins(*labels: np.ndarray) -> np.ndarray:
    """Return which rows begin a run in which no label changes, (T,) bool."""
    first = np.ones(len(labels[0]), bool)
    first[1:] = np.any([label[1:] != label[:-1] for label in labels], axis=0)
    return first


def usual_step(time: np.ndarray, trial: np.ndarray) -> float:
    """
    Return the usual time between rows, s.

    The median over many rows each, as rows may come in packets, but not over those with a pause:
    one in every hundred rows would be in most of them.
    """
    count = int(np.clip(np.median(np.bincount(trial - trial.min())) // 2, 1, WINDOWS[-1]))
    steps = (time[count:] - time[:-count]) / count
    whole = trial[count:] == trial[:-count]
    if not whole.any():
        return 1.0
    pause = np.diff(time, prepend=time[0]) > PAUSE_STEPS * np.percentile(steps[whole], 25)
    pauses = np.cumsum(pause)
    without = whole & (pauses[count:] == pauses[:-count])
    return float(np.median(steps[without if without.any() else whole]))


def parts_of(time: np.ndarray, trial: np.ndarray) -> list[np.ndarray]:
    """
    Return the rows of each stretch that windows stay in: a trial, up to a pause of the log.

    A pause is longer than the widest window. Fitted across one of hours, the rows on either side
    of it would be at one time.
    """
    pause = np.diff(time) > PAUSE_STEPS * usual_step(time, trial)
    return np.split(np.arange(len(time)), np.flatnonzero(pause | (np.diff(trial) != 0)) + 1)


def spread(gaps: np.ndarray, quantum: float = 0.0) -> float:
    """
    Return the standard deviation of differences with outliers, by their median deviation.

    Differences of readings in steps (``quantum``, 0 for none) are multiples of the step: where it
    is not small beside them, the median deviation is one too, often zero. The standard deviation
    of those within 5 of it, or of the step, is taken then.
    """
    gaps = gaps - np.median(gaps)
    robust = float(ROBUST * np.median(np.abs(gaps)))
    if robust > 4.0 * quantum:
        return robust
    return float(gaps[np.abs(gaps) <= 5.0 * max(robust, quantum)].std())


def sample_noise(value: np.ndarray, trial: np.ndarray) -> float:
    """
    Return the white-noise standard deviation of a sampled signal, by third differences.

    Most differences of a signal that is read in few steps are zero, those of one that is held
    between two steps among them.
    """
    third = np.diff(value, 3)[trial[3:] == trial[:-3]]
    if len(third) < 4:
        return 0.0
    changed = np.abs(third[_beyond_rounding(third, value)])
    # few changes, of three differences each, are levels that were set one after another
    quantum = float(changed.min()) if len(changed) > 3 * _CHANGES else 0.0
    return spread(third, quantum) / np.sqrt(20.0)


def noise_of(time: np.ndarray, value: np.ndarray, trial: np.ndarray) -> float:
    """
    Return the noise of a signal, with the q / sqrt(12) of a reading in steps of q.

    Where trials have a few rows, or rows that are uneven in time, third differences are those of
    turning points and steps of the clock: then differences by the clock count, of rows between
    which the signal goes on one way.
    """
    found, step = sample_noise(value, trial), signal_step(value, trial)
    if step > 0.0 or found <= 0.0:
        return max(found, float(step / np.sqrt(12.0)))
    onward = _noise_onward(time, value, trial)
    return onward if onward < found / _TURNS else found


def _noise_onward(time: np.ndarray, value: np.ndarray, trial: np.ndarray) -> float:
    """
    Return the noise of a signal by third divided differences where it goes on one way.

    Infinite where that is rare, as in white noise: at one in twelve places.
    """
    at = np.stack([time[k:len(time) - 3 + k] for k in range(4)])
    way = np.sign(np.diff(value))
    whole = (trial[3:] == trial[:-3]) & (np.diff(at, axis=0) > 0.0).all(axis=0)
    onward = whole & (np.abs(way[:-2] + way[1:-1] + way[2:]) == 3.0)
    if onward.sum() < max(_ONWARD, 0.25 * whole.sum()):
        return np.inf
    at = (at - at[:1])[:, onward]
    weight = 1.0 / (at[:, None] - at[None] + np.eye(4)[:, :, None]).prod(axis=1)
    third = sum(weight[k] * value[k:len(value) - 3 + k][onward] for k in range(4))
    return spread(third / np.sqrt((weight ** 2).sum(axis=0)))


def _beyond_rounding(difference: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Return which differences of a signal are not those of its last digits, bool."""
    return np.abs(difference) > 1e-9 * max(float(np.ptp(value)), 1e-12)


class Slope(NamedTuple):
    """A smoothed slope per s, its noise's standard deviation, and its window in rows, all (T,)."""

    rate: np.ndarray
    noise: np.ndarray
    window: np.ndarray


def slope(time: np.ndarray, value: np.ndarray, trial: np.ndarray) -> Slope:
    """
    Return the smoothed slope of a signal, all (T,).

    Rows of one trial are neighbours; no window reaches across trials or long pauses. Each sample
    has the widest window whose slope is within the noise of that of each narrower one, at
    `FALSE_ALARM` (intersection of confidence intervals): where a motion sets in, the fit may miss
    it and yet miss little in the whole log. The jumps of a reading in steps look like that too.
    """
    noise, parts = noise_of(time, value, trial), parts_of(time, trial)
    widest = WINDOWS[0]
    best, corners = with_corners(time, value, parts, widest // 2, noise)
    for window in WINDOWS[1:]:
        if noise * np.median(best.slope_sd) < 0.005 * np.sqrt(np.mean(best.slope ** 2)):
            break
        local, found = with_corners(time, value, parts, window // 2, noise)
        if misses(value, local.value, noise, window):
            break
        widest, best, corners = window, local, found
    if signal_step(value, trial) > noise:
        return Slope(best.slope, noise * best.slope_sd, np.full(len(time), widest))
    straight = value if corners is None else value - corners.ramp
    own = _narrowed(time, straight, parts, widest, noise)
    return own if corners is None else own._replace(rate=corners.given_back(own.rate))


def _narrowed(time: np.ndarray, value: np.ndarray, parts: list[np.ndarray], widest: int,
              noise: float) -> Slope:
    """Return the slope of a signal without corners, each sample by its own window, see `slope`."""
    beyond = -ndtri(0.5 * FALSE_ALARM / len(time))
    rate, error = np.zeros(len(time)), np.full(len(time), np.inf)
    width, going = np.full(len(time), widest), np.ones(len(time), bool)
    for window in (*[each for each in WINDOWS[::2] if each < widest], widest):
        local = locally(time, value, parts, window // 2)
        going &= with_neighbours(np.abs(local.slope - rate) <= beyond * error)
        rate = np.where(going, local.slope, rate)
        error = np.where(going, noise * local.slope_sd, error)
        width = np.where(going, window, width)
    return Slope(rate, error, width)


def with_neighbours(fits: np.ndarray) -> np.ndarray:
    """Return which rows fit, (T,) bool, as do both neighbours: a bend shows there first."""
    return fits & np.roll(fits, 1) & np.roll(fits, -1)


def misses(value: np.ndarray, fitted: np.ndarray, noise: float, window: int) -> bool:
    """Return whether local quadratics of this window, in rows, miss more than the noise."""
    leverage = 1.0 - 2.25 / window
    missed = float(np.mean((value - fitted) ** 2))
    return missed > 1.3 * noise ** 2 * leverage + (0.3 * noise) ** 2


def _corners(time: np.ndarray, value: np.ndarray, parts: list[np.ndarray], half: int,
             noise: float, local: _Local) -> Corners | None:
    """
    Return the corners of a signal, as the tips of a triangle, or None where it has none.

    A corner is where the slope changes suddenly by more than noise makes it, at `FALSE_ALARM`,
    and by most within its window. What is missed with the corner counts as noise: a jump is none.
    ``local`` is `_local` of the signal with this half window.
    """
    rounding = np.finfo(float).eps * float(np.abs(value).max())
    scatter = np.maximum(local.missed, max(noise, rounding, np.finfo(float).tiny))
    size = np.abs(local.bend) / (local.bend_sd * scatter)
    corner = (size > -ndtri(0.5 * FALSE_ALARM / len(time))) & (
        size == maximum_filter1d(size, 2 * half + 1))
    if not corner.any():
        return None
    # between the samples it is where a parabola through three changes of slope is largest
    last, here, then = (np.roll(local.bend, by) for by in (1, 0, -1))
    curved = last - 2.0 * here + then
    share = np.divide(0.5 * (last - then), curved, out=np.zeros(len(time)),
                      where=corner & (curved * here < 0.0))
    late = np.clip(share, -0.5, 0.5) * np.gradient(time)
    bend, passed = np.where(corner, here, 0.0), late < 0.0
    before, ramp = np.zeros(len(time)), np.zeros(len(time))
    for rows in parts:
        before[rows] = np.cumsum(bend[rows]) - bend[rows]
        shift = -bend[rows] * late[rows]
        ramp[rows] = (np.cumsum(np.diff(time[rows], prepend=time[rows[0]]) * before[rows])
                      + np.cumsum(shift) - np.where(passed[rows], 0.0, shift))
    # half of the error of the change is on either side, within the window
    error = maximum_filter1d(np.where(corner, 0.5 * local.bend_sd * scatter, 0.0), 2 * half + 1)
    return Corners(ramp, before, bend, passed, error)


def with_corners(time: np.ndarray, value: np.ndarray, parts: list[np.ndarray], half: int,
                 noise: float) -> tuple[_Local, Corners | None]:
    """
    Return a signal and its slope, smoothed but for its corners, and the corners.

    Corners are taken from the signal before it is smoothed, and given back. The sample next to a
    tip has no slope: which of both it has is not known well enough. Nor has a slope within the
    window of a corner that is not beyond the error of its change.
    """
    local = locally(time, value, parts, half)
    found = _corners(time, value, parts, half, noise, local)
    if found is None:
        return local, None
    smooth = locally(time, value - found.ramp, parts, half)
    return smooth._replace(value=smooth.value + found.ramp,
                           slope=found.given_back(smooth.slope)), found


def signal_step(value: np.ndarray, trial: np.ndarray) -> float:
    """
    Return the step that a sampled signal is read in, 0 where it is read in none.

    All changes from sample to sample are multiples of it. At least 16 changes and a range of 16
    steps are asked for: levels that were set one after another are no resolution. Nor is the
    change of an even ramp: but for its ends, its samples neither stay nor skip a step.
    """
    every = np.abs(np.diff(value))[np.diff(trial) == 0]
    moved = _beyond_rounding(every, value)
    change = every[moved]
    if len(change) < _CHANGES:
        return 0.0
    step = float(change.min())
    share = change / step
    whole = np.abs(share - np.round(share)) < 0.05
    stays = (np.diff(moved) != 0).sum() > 0.2 * len(change)
    uneven = stays or (share > 1.5).mean() > 0.05
    return step if uneven and whole.mean() > 0.99 and np.ptp(value) > 16.0 * step else 0.0


def direction(time: np.ndarray, rate: np.ndarray, rate_noise: np.ndarray, trial: np.ndarray,
              least: float) -> np.ndarray:
    """
    Return +1 rising, -1 falling, 0 where the motion is not beyond its own noise, (T,) int.

    Crawling counts as rest: below 3 sd of the rate's noise, or 2 % of the usual fast motion. So
    does a run of samples one way that nowhere exceeds what noise reaches in such a log, at
    `FALSE_ALARM`, or whose travel is less than ``least``, in the unit of the signal: a signal that
    is constant but for noise or rounding rests. ``rate`` (T,) is its smoothed slope,
    ``rate_noise`` (T,) the standard deviation of its noise.
    """
    fast = np.percentile(np.abs(rate), 90) if len(rate) else 0.0
    threshold = np.maximum(3.0 * rate_noise, CRAWL * fast)
    way = np.where(rate > threshold, 1, np.where(rate < -threshold, -1, 0))
    run = np.cumsum(begins(way, trial)) - 1
    duration = np.diff(time, append=time[-1:])
    duration[np.append(np.diff(trial) != 0, True)] = 0.0
    travel = np.bincount(run, np.abs(rate) * duration)
    highest = -ndtri(0.5 * FALSE_ALARM / max(len(rate), 1)) * rate_noise
    moves = np.bincount(run, np.abs(rate) > highest) > 0.0
    return np.where((travel >= least)[run] & moves[run], way, 0)


def turning(moving: np.ndarray, trial: np.ndarray, window: np.ndarray) -> np.ndarray:
    """
    Return the rows, (T,) bool, in which it is not known whether, or which way, there is motion.

    At a short rest between opposite motions, or between a motion and the beginning or end
    of its trial; and within half a window of the beginning or end of a hold, a rest longer than
    the window of the slope, as that smooths the rate there. ``moving`` (T,) is +1, -1, and 0 where
    the motion is not beyond its own noise; the window (T,) is in rows.
    """
    begin = np.flatnonzero(begins(moving, trial))
    length = np.diff(begin, append=len(moving))
    way, of = moving[begin], trial[begin]
    # the motions before and after, 0 for none in the trial
    before = np.append(0, np.where(of[1:] == of[:-1], way[:-1], 0))
    after = np.append(np.where(of[1:] == of[:-1], way[1:], 0), 0)
    rest, short = way == 0, length <= window[begin]
    unknown = np.repeat(rest & short & (before != after), length)
    held = rest & ~short
    for row in begin[1:][(held[1:] != held[:-1]) & (of[1:] == of[:-1])]:
        unknown[max(row - window[row] // 2, 0):row + window[row] // 2] = True
    return unknown
