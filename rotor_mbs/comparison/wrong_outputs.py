"""Find the mistakes with which a method computes wrong rows, tips, energies or loads.

Tips, energies and loads are compared with the results of common mistakes at the same states. Rows
are corrected for a mistake, and their defects are computed again. A mistake is named if it leaves
at most a thousandth of the difference or of the defects. A mistake in tips is named only if no
other mistake does so, too, and mistakes in an energy only if there are at most three. For mistakes
in loads the rules of `comparison.loads` hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis import kinematics
from rotor_mbs.analysis.judgement import defects_of
from rotor_mbs.comparison.channels import channels
from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.comparison.loads import compare_loads, shaft_direction
from rotor_mbs.comparison.other_rotors import other_azimuths, other_scenes
from rotor_mbs.comparison.verdict import DEFAULT_TOLERANCE
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.quantities import LOADS
from rotor_mbs.solution.trajectory import Array, Trajectory

_LEFT = 1e-3  # largest share of a difference that a named mistake may leave
_STRAIGHT = 0.3  # share of rows on straight lines, above which rows are taken to be interpolated
# Largest number of mistakes that may explain an energy; if there are more, none is named. Also the
# largest number of blades whose wrong tips are named.
_MAX_ALIKE = 3


# Rows


def wrong_rows(scene: Scene, run: Trajectory, defects: Defects) -> str:
    """Return the mistake by which the rows of a run differ from a right motion.

    Parameters
    ----------
    scene : the rotor.
    run : samples of the run, with angles and rates.
    defects : interval defects of the run.

    Returns
    -------
    str
        The mistake in words, "" if none that was tried explains the defects.
    """
    text = _interpolated_rows(run, defects) or _differenced_rates(run)
    if text:
        return text
    time, angles, rates = run.time, run.angles, run.rates
    before, after = slice(None, -1), slice(1, None)
    opposite = np.array([1.0, *[-1.0] * len(scene.blades)])
    degree = np.pi / 180.0
    trials = {
        "rates are a row late": (time[before], angles[before], rates[after]),
        "rates are a row early": (time[after], angles[after], rates[before]),
        "rates are in degrees per second": (time, angles, degree * rates),
        "rates are in revolutions per minute": (time, angles, np.pi / 30.0 * rates),
        "rates are in revolutions per second": (time, angles, 2.0 * np.pi * rates),
        "rates have the opposite sign": (time, angles, -rates),
        "angles are in degrees": (time, degree * angles, rates),
        "angles and rates are in degrees": (time, degree * angles, degree * rates),
        "pitches have the opposite sign": (time, opposite * angles, opposite * rates),
    }
    if len(scene.blades) > 1:
        order = [0, *range(len(scene.blades), 0, -1)]
        text = "pitches are in the reverse order of the blades"
        trials[text] = (time, angles[:, order], rates[:, order])
    for text, arrays in trials.items():
        other = defects_of(scene, Trajectory(*arrays))
        if other is not None and root_mean_square(other) <= _LEFT * root_mean_square(defects):
            return text
    return ""


def root_mean_square(defects: Defects) -> float:
    """Return the root mean square of the defects over the intervals, rad, above zero."""
    mean = float(np.sqrt(np.mean(np.square(defects.sizes))))
    return max(mean, float(np.finfo(float).tiny))


def _interpolated_rows(run: Trajectory, defects: Defects) -> str:
    """Return a text if many rows are linearly interpolated between other rows; else "".

    Parameters
    ----------
    run : samples of the run, with angles.
    defects : interval defects of the run.
    """
    angles = run.angles
    if len(angles) < 3:
        return ""
    size = np.maximum(np.abs(angles).max(axis=0), 1.0)
    bend = np.abs(angles[2:] - 2.0 * angles[1:-1] + angles[:-2])
    is_straight = (bend <= 1e-12 * size).all(axis=1) & np.ptp(angles, axis=0).any()
    share = float(is_straight.mean())
    # A uniform rotation is a straight line, too. But it has no defects, and rows on the line do not
    # alternate with rows off the line.
    changes = np.count_nonzero(np.diff(is_straight.astype(int)))
    if share <= _STRAIGHT or changes < 4:
        return ""
    if np.median(defects.sizes[1:][is_straight]) <= _LEFT * defects.sizes.max():
        return ""
    where = "lie on straight lines between others: linear interpolation"
    return f"{100.0 * share:.0f} % of the rows {where}"


def _differenced_rates(run: Trajectory) -> str:
    """Return a text if the rates are difference quotients of the angles of rows; else "".

    Parameters
    ----------
    run : samples of the run, with angles and rates.
    """
    if len(run.time) < 4:
        return ""
    slopes = np.diff(run.angles, axis=0) / np.diff(run.time)[:, None]
    quotients = {
        "backward": (run.rates[1:], slopes),
        "forward": (run.rates[:-1], slopes),
        "central": (run.rates[1:-1], 0.5 * (slopes[1:] + slopes[:-1])),
    }
    size = max(float(np.abs(run.rates).max()), float(np.finfo(float).tiny))
    # In a uniform rotation the quotients equal the rates, however the rates were computed.
    is_uniform = np.ptp(run.rates, axis=0).max() <= 1e-9 * size
    for text, (rates, quotient) in quotients.items():
        if not is_uniform and np.abs(rates - quotient).max() <= 1e-9 * size:
            return f"rates are {text} differences of the angles of rows"
    return ""


# Tips


def wrong_tip(scene: Scene, run: Trajectory) -> str:
    """Return the mistake in the tip paths of a run, in words; "" if unknown.

    Parameters
    ----------
    scene : the rotor.
    run : samples of the run, with `tip`.
    """
    assert run.tip is not None
    own = kinematics.tip_paths(scene, run.angles)
    named = _explaining(run.tip, own, dict(_other_tips(scene, run.angles, own)))
    if len(named) == 1:
        return named[0]
    if named:
        return ""
    return _other_tip_points(scene, run.tip, run.angles, own)


def _other_tips(scene: Scene, angles: Array, own: Array) -> Iterator[tuple[str, Array]]:
    """Yield mistakes in words, each with the wrong tip paths that it gives.

    Parameters
    ----------
    scene : the rotor.
    angles : (n, 1 + blades) rad, rotor first.
    own : (n, blades, 3) m, the right paths.

    Yields
    ------
    str, ndarray
        The mistake in words; the tip paths, (n, blades, 3) m.
    """
    pitches = np.array([0.0, *[1.0] * len(scene.blades)])
    factors = {
        "tips without the rotation by the pitch": 1.0 - pitches,
        "tips without the rotation of the rotor": pitches,
        "tips with the pitch in the opposite sense": 1.0 - 2.0 * pitches,
        "tips with the rotor turned in the opposite sense": 2.0 * pitches - 1.0,
    }
    for text, factor in factors.items():
        yield text, kinematics.tip_paths(scene, angles * factor)
    for order, place in _exchanges(len(scene.blades)):
        yield f"tips {place}", own[:, order]
    yield (
        "centres of mass in place of tips",
        kinematics.tip_paths(_with_tips_at_centres(scene), angles),
    )
    x, y, z = np.moveaxis(own, 2, 0)
    yield "y and z of the tips exchanged", np.stack([x, z, y], axis=2)
    yield "x and z of the tips exchanged", np.stack([z, y, x], axis=2)
    yield "tips in mm", 1e3 * own
    for text, azimuths in other_azimuths(scene):
        yield text, _turned_about_shaft(scene, own, np.array(azimuths) - scene.phases)
    for text, other in _leaning_otherwise(scene):
        yield text, kinematics.tip_paths(other, angles)


def _leaning_otherwise(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """Yield the mistakes and scenes of `other_scenes` in which tilt or cones are different."""
    cones = [blade.cone for blade in scene.blades]
    for text, other in other_scenes(scene):
        if other.shaft_tilt != scene.shaft_tilt or [blade.cone for blade in other.blades] != cones:
            yield text, other


def _other_tip_points(scene: Scene, tip: Array, angles: Array, own: Array) -> str:
    """Return the offset of the tips in words, if it is constant in some frame; "" if not.

    Parameters
    ----------
    scene : the rotor.
    tip, own : (n, blades, 3) m, paths of the run, and the right paths.
    angles : (n, 1 + blades) rad, rotor first.
    """
    allowed = _LEFT * float(np.abs(tip - own).max())
    without_pitches = angles * np.array([1.0, *[0.0] * len(scene.blades)])
    frames = {
        "of the blade's frame": _blade_frames(scene, angles),
        "of a frame that turns with the rotor, z along the blade": _blade_frames(
            scene, without_pitches
        ),
        "of the base": np.zeros((*own.shape, 3)) + np.eye(3),
    }
    for text, axes in frames.items():
        offsets = np.einsum("nbij,nbi->nbj", axes, tip - own).mean(axis=0)
        if np.abs(tip - own - np.einsum("nbij,bj->nbi", axes, offsets)).max() > allowed:
            continue
        offsets[np.abs(offsets) <= allowed] = 0.0  # as small as errors that a mistake may leave
        shown = ["(" + ", ".join(f"{x:.4g}" for x in offset) + ")" for offset in offsets]
        if len(set(shown)) == 1:
            return f"tips off by {shown[0]} m {text}"
        wrong = [i for i, offset in enumerate(offsets) if offset.any()]
        texts = [f"tip of blade {i + 1} off by {shown[i]} m {text}" for i in wrong[:_MAX_ALIKE]]
        return "; ".join(texts)
    return ""


def _blade_frames(scene: Scene, angles: Array) -> Array:
    """Return the axes of the blades' frames in the base frame, as columns of (n, blades, 3, 3)."""
    columns = []
    for axis in np.eye(3):
        point = (float(axis[0]), float(axis[1]), float(axis[2]))
        blades = tuple(replace(blade, tip=point) for blade in scene.blades)
        columns.append(kinematics.tip_paths(replace(scene, blades=blades), angles))
    return np.stack(columns, axis=3)


# Energies


def wrong_energy(scene: Scene, run: Trajectory, name: str) -> str:
    """Return the mistake in an energy of a run.

    Parameters
    ----------
    scene : the rotor.
    run : samples of the run, with this energy.
    name : "kinetic energy" or "potential energy"; for other names no mistake is searched for.

    Returns
    -------
    str
        All mistakes that explain the energy, in words; "" if there are none or more than three.
    """
    if name == "kinetic energy":
        stored, own = run.kinetic_energy, kinematics.kinetic_energy(scene, run.angles, run.rates)
        trials = dict(_other_kinetic_energies(scene, run, own))
    elif name == "potential energy":
        stored = run.potential_energy
        own = kinematics.potential_energy(scene, run.time, run.angles)
        trials = dict(_other_potential_energies(scene, run, own))
    else:
        return ""
    assert stored is not None
    named = _explaining(stored, own, trials)
    return " or ".join(named) if len(named) <= _MAX_ALIKE else ""


def _other_kinetic_energies(
    scene: Scene, run: Trajectory, own: Array
) -> Iterator[tuple[str, Array]]:
    """Yield mistakes in words, each with the wrong kinetic energy that it gives, (n,) J.

    Parameters
    ----------
    scene : the rotor.
    run : samples of the run.
    own : (n,) J, the right energy.
    """
    yield from _scaled(own)
    rotor = np.array([1.0, *[0.0] * len(scene.blades)])
    for text, factor in (("rates of the pitches", rotor), ("rate of the rotor", 1.0 - rotor)):
        rates = run.rates * factor
        yield f"without the {text}", kinematics.kinetic_energy(scene, run.angles, rates)
    for text, other in other_scenes(scene):
        yield text, kinematics.kinetic_energy(other, run.angles, run.rates)


def _other_potential_energies(
    scene: Scene, run: Trajectory, own: Array
) -> Iterator[tuple[str, Array]]:
    """Yield mistakes in words, each with the wrong potential energy that it gives, (n,) J.

    Parameters
    ----------
    scene : the rotor.
    run : samples of the run, with the stored potential energy.
    own : (n,) J, the right energy.
    """
    yield from _scaled(own)
    yield "zero at another height", own + (run.potential_energy - own)[0]
    of_weights = kinematics.potential_energy(_without_springs(scene), run.time, run.angles)
    for text, factor in (("without the share", 0.0), ("opposite sign of the share", -1.0)):
        yield f"{text} of the weights", own + (factor - 1.0) * of_weights
        yield f"{text} of the springs", of_weights + factor * (own - of_weights)
    paths = kinematics.tip_paths(_with_tips_at_centres(scene), run.angles)
    weights = scene.gravity * np.array([blade.mass for blade in scene.blades])
    for text, azimuths in other_azimuths(scene):
        turned = _turned_about_shaft(scene, paths, np.array(azimuths) - scene.phases)
        yield text, own + (turned - paths)[:, :, 2] @ weights
    for text, other in other_scenes(scene):
        yield text, kinematics.potential_energy(other, run.time, run.angles)


def _scaled(own: Array) -> Iterator[tuple[str, Array]]:
    """Yield wrong factors in words, each with an energy times this factor."""
    for text, factor in (("opposite sign", -1.0), ("half of it", 0.5), ("twice of it", 2.0)):
        yield text, factor * own


def _without_springs(scene: Scene) -> Scene:
    """Return a scene without springs in its pitch bearings."""
    return replace(scene, bearing_stiffness=())


# Loads


def wrong_loads(scene: Scene, run: Trajectory) -> str:
    """Return the mistakes in the loads of a run, in words, as `compare` finds them; "" if unknown.

    Parameters
    ----------
    scene : the rotor.
    run : samples of the run, with the loads that are examined.
    """
    defects = defects_of(scene, run)
    by_load = {load.name: run.get(load.name) for load in LOADS}
    chosen, columns = [], []
    known = [channel for channel in channels(scene) if channel.is_load]
    for load, values in by_load.items():
        of_load = [channel for channel in known if channel.key.startswith(load)]
        if values is not None:
            chosen += of_load
            columns.append(values.reshape(len(run.time), -1))
    if defects is None or not chosen:
        return ""
    values = np.hstack(columns)
    rounding = 2.0**-53 * np.abs(values)
    data = ForeignData("the run", run.time, values, tuple(chosen), rounding, 0.0 * run.time)
    return "; ".join(compare_loads(scene, data, defects, DEFAULT_TOLERANCE).likely)


# Functions for several outputs


def _explaining(stored: Array, own: Array, trials: Mapping[str, Array]) -> list[str]:
    """Return the names of the trials that leave at most a thousandth of `stored` minus `own`."""
    difference = float(np.abs(stored - own).max(initial=0.0))
    named = []
    for text, values in trials.items():
        if np.abs(stored - values).max(initial=0.0) <= _LEFT * difference:
            named.append(text)
    return named if difference > 0.0 else []


def _exchanges(count: int) -> Iterator[tuple[NDArray[np.intp], str]]:
    """Yield wrong orders of the blades, each with its mistake in words.

    Parameters
    ----------
    count : number of blades.

    Yields
    ------
    ndarray, str
        For each blade the index of the blade whose values it has, (count,); the mistake in words.
    """
    blades = np.arange(count)
    orders = {
        "of the blades in reverse order": blades[::-1],
        "of blade 1 for all blades": 0 * blades,
        "of the next blade for each blade": np.roll(blades, -1),
        "of the previous blade for each blade": np.roll(blades, 1),
    }
    # With one or two blades several of these orders are equal to each other or to the right order.
    seen = [blades.tolist()]
    for text, order in orders.items():
        if order.tolist() not in seen:
            seen.append(order.tolist())
            yield order, text


def _with_tips_at_centres(scene: Scene) -> Scene:
    """Return a scene in which the tip of each blade is its centre of mass."""
    blades = tuple(replace(blade, tip=blade.centre_of_mass) for blade in scene.blades)
    return replace(scene, blades=blades)


def _turned_about_shaft(scene: Scene, paths: Array, angles: Array) -> Array:
    """Return vectors of the base frame, (n, blades, 3), turned about the shaft by (blades,) rad."""
    s, c = np.sin(angles)[:, None], np.cos(angles)[:, None]
    axis = shaft_direction(scene, "")
    # Rodrigues' formula.
    along = (paths @ axis)[..., None] * axis
    return along + c * (paths - along) + s * np.cross(axis, paths)
