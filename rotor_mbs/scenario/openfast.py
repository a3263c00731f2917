"""Read the rotor of an OpenFAST model: geometry, masses, initial state, and what no scene can have.

The masses of the blades are those with which OpenFAST computes: ElastoDyn's sum over its nodes, or
the integral over BeamDyn's stations. OpenFAST's axes x (downwind), y, z are the scene's axes y, -x,
z.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.openfast_files import MAX_ROWS, InputFile, table_columns
from rotor_mbs.scenario.toml_file import shown_path

MAX_NODES = 10_000  # largest number of nodes of a blade
_ANGLE = keys.within(keys.NUMBER, at_least=-360.0, at_most=360.0)
_TILT = keys.within(keys.NUMBER, at_least=-90.0, at_most=90.0)
_CONE = keys.within(keys.NUMBER, at_least=-85.0, at_most=85.0)
_TABLE = "DISTRIBUTED"  # word in the header of BeamDyn's stations
# Number of rows of each matrix of BeamDyn. A station has a stiffness matrix, then a mass matrix.
_MATRIX_ROWS = 6
# Relative difference of node sum and integral above which the difference is reported to the user.
_SHOWN_DIFFERENCE = 1e-3


@dataclass(frozen=True)
class BladeModel:
    """Mass properties and start of a blade of an OpenFAST model, in the scene's axes.

    Attributes
    ----------
    source : text that says from what the mass properties were computed.
    mass : kg.
    first_moment, second_moment : ∫ z dm and ∫ z² dm, where z is the distance from the root along
        the blade, kg m and kg m².
    centre_of_mass : (3,) m, from the root.
    inertia : elements xx yy zz xy xz yz of the inertia about the centre of mass, kg m².
    tip : (3,) m, position of the tip from the root.
    cone : degrees, positive if the blade leans towards +y.
    pitch : degrees, initial pitch with OpenFAST's sign: positive towards feather.
    notes : further texts for comments in the scene file.
    """

    source: str
    mass: float
    first_moment: float
    second_moment: float
    centre_of_mass: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]
    tip: tuple[float, float, float]
    cone: float = 0.0
    pitch: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def body(self) -> tuple[object, ...]:
        """Return the properties in which equal blades agree: those of the body, not the pitch."""
        return self.mass, self.centre_of_mass, self.inertia, self.tip, self.cone


@dataclass(frozen=True)
class OpenFastRotor:
    """The rotor of an OpenFAST model.

    Attributes
    ----------
    path, description : path of the .fst file, and the description in it.
    blades : (blades,) `BladeModel`.
    hub_radius : m, distance of the blade roots from the apex.
    hub_mass : kg.
    hub_centre_of_mass : m, distance of the hub's centre of mass downwind of the apex.
    hub_inertia : kg m², two inertias about the shaft: that of the hub, and that of the generator.
    hub_inertia_text : sum of the two inertias, as arithmetic with the numbers of the model.
    tilt : degrees.
    gravity : m/s².
    azimuth : degrees, initial azimuth of blade 1.
    azimuth_up : degrees, azimuth of blade 1 at which the blade points up.
    speed : rpm, initial speed of the rotor.
    undersling : m, distance from the teeter pin to the apex; 0 unless the rotor has two blades.
    bearing : stiffness (N m/rad), damping (N m s/rad) and neutral pitch (degrees) of each pitch
        bearing; () if the pitch is prescribed.
    duration : s, duration of the model's run.
    left_out : texts about what the model has and no scene has, the most important first.
    """

    path: Path
    description: str
    blades: tuple[BladeModel, ...]
    hub_radius: float
    hub_mass: float
    hub_centre_of_mass: float
    hub_inertia: tuple[float, float]
    hub_inertia_text: str
    tilt: float
    gravity: float
    azimuth: float
    azimuth_up: float
    speed: float
    undersling: float
    bearing: tuple[tuple[float, float, float], ...]
    duration: float
    left_out: tuple[str, ...]

    @property
    def has_equal_blades(self) -> bool:
        """Return whether all blades have equal bodies; their initial pitches may differ."""
        return len({blade.body for blade in self.blades}) == 1

    @property
    def inertia(self) -> float:
        """Return the rotor's inertia about the shaft, kg m², as OpenFAST's summary prints it.

        The summary treats each blade as a line of mass on its pitch axis. The inertia of the
        generator is not included.
        """
        total = self.hub_inertia[0]
        for blade in self.blades:
            about_apex = blade.second_moment + 2.0 * self.hub_radius * blade.first_moment
            about_apex += self.hub_radius**2 * blade.mass
            total += about_apex * math.cos(math.radians(blade.cone)) ** 2
        return total


def read_rotor(path: Path) -> OpenFastRotor:
    """Read the rotor of an OpenFAST model.

    Parameters
    ----------
    path : path of the .fst file. Only those files that it names are read which the rotor needs.

    Raises
    ------
    InputError
        If a file or line is missing, a number is not allowed, or no scene can be made from the
        model.
    """
    main = InputFile(path, what="the main input file (.fst) of an OpenFAST model")
    if "CompElast" not in main and "NumBl" in main:
        what = "a model of FAST v7, which is one file"
        raise InputError(f"{shown_path(path)}: {what}; allowed: a model of FAST v8 or OpenFAST")
    elastic = main.whole("CompElast", 1, 3)
    if elastic == 3:
        allowed = "1 (ElastoDyn) or 2 (BeamDyn)"
        what = "3, Simplified ElastoDyn: the model has a rotor inertia and no blades"
        raise main.problem("CompElast", what, allowed)
    structure = main.file("EDFile", "an input file of ElastoDyn")
    count = structure.whole("NumBl", 1, 3)
    tip_radius = structure.number("TipRad", keys.POSITIVE)
    hub_radius = structure.number("HubRad", keys.NOT_NEGATIVE)
    if hub_radius >= tip_radius:
        allowed = f"a number below TipRad, {tip_radius:g} m"
        raise structure.problem("HubRad", f"{hub_radius:g} m leaves no blade", allowed)

    blades = []
    for number in range(1, count + 1):
        read_blade = _beamdyn_blade if elastic == 2 else _elastodyn_blade
        blades.append(read_blade(main, structure, number))

    hub, hub_text = _hub_inertia(structure, count)
    generator = structure.number("GenIner", keys.NOT_NEGATIVE)
    ratio = structure.number("GBRatio", keys.SIZE)
    gravity_file = main if "Gravity" in main else structure
    return OpenFastRotor(
        path=path,
        description=main.description,
        blades=tuple(blades),
        hub_radius=hub_radius,
        hub_mass=structure.number("HubMass", keys.NOT_NEGATIVE),
        hub_centre_of_mass=structure.number("HubCM", keys.SIZE),
        hub_inertia=(hub, generator * ratio**2),
        hub_inertia_text=f"{hub_text} + {plain_number(generator)}*{plain_number(ratio)}**2",
        tilt=structure.number("ShftTilt", _TILT),
        gravity=gravity_file.number("Gravity", keys.NOT_NEGATIVE),
        azimuth=structure.number("Azimuth", _ANGLE),
        azimuth_up=structure.number("AzimB1Up", _ANGLE),
        speed=structure.number("RotSpeed", keys.SIZE),
        undersling=structure.number("UndSling", keys.SIZE) if count == 2 else 0.0,
        bearing=_bearing(main, structure, blades),
        duration=main.number("TMax", keys.NOT_NEGATIVE),
        left_out=tuple(_left_out(main, structure, elastic, count)),
    )


def plain_number(number: float) -> str:
    """Return the text of a number for arithmetic in a scene file, without a final ".0"."""
    return repr(number).removesuffix(".0")


# Hub and bearing


def _hub_inertia(structure: InputFile, count: int) -> tuple[float, str]:
    """Return the hub's inertia about the shaft, and its text as arithmetic of the file's numbers.

    Parameters
    ----------
    structure : ElastoDyn's primary file.
    count : number of blades.

    Returns
    -------
    float, str
        Inertia in kg m², and its text.

    Raises
    ------
    InputError
        If the inertia about the shaft of a two-bladed rotor is negative.
    """
    inertia = structure.number("HubIner", keys.NOT_NEGATIVE)
    if count != 2 or "HubIner_Teeter" in structure:
        return inertia, plain_number(inertia)
    # In files before OpenFAST 4.2, HubIner of a two-bladed rotor is the inertia about the teeter
    # axis. OpenFAST converts it to the hub's centre of mass, and uses the result as the inertia
    # about the shaft, too.
    mass = structure.number("HubMass", keys.NOT_NEGATIVE)
    undersling = structure.number("UndSling", keys.SIZE)
    centre = structure.number("HubCM", keys.SIZE)
    arm = undersling - centre
    about_shaft = inertia - mass * arm**2
    if about_shaft < 0.0:
        least = mass * arm**2
        what = f"{inertia:g} kg m² is below HubMass (UndSling - HubCM)²"
        raise structure.problem("HubIner", what, f"at least {least:g} for two blades")
    if not mass * arm:
        return inertia, plain_number(inertia)
    distance = f"{plain_number(undersling)} - {plain_number(centre)}"
    text = f"{plain_number(inertia)} - {plain_number(mass)}*({distance})**2"
    return about_shaft, text.replace("- -", "+ ")


def _bearing(
    main: InputFile,
    structure: InputFile,
    blades: Sequence[BladeModel],
) -> tuple[tuple[float, float, float], ...]:
    """Return stiffness, damping and neutral pitch (degrees) of each pitch bearing.

    Since version 5 OpenFAST reads these from the file of ServoDyn.

    Parameters
    ----------
    main, structure : the .fst file and ElastoDyn's primary file.
    blades : blades of the rotor.

    Returns
    -------
    tuple of (float, float, float)
        Values in N m/rad, N m s/rad and degrees for each bearing; () if the pitch is prescribed.

    Raises
    ------
    InputError
        If the pitch is free and a blade has no inertia about its pitch axis.
    """
    if not structure.flag("PitchDOF"):
        return ()
    for number, blade in enumerate(blades, 1):
        if not blade.inertia[2] and not any(blade.centre_of_mass[:2]):
            what = f"True, and blade {number} has no inertia about its pitch axis"
            allowed = f"BlPIner({number}) above 0, or PitchDOF False"
            raise structure.problem("PitchDOF", what, allowed)
    if not main.whole("CompServo", 0, 100, 0):
        return ((0.0, 0.0, 0.0),) * len(blades)
    servo = main.file("ServoFile", "an input file of ServoDyn")
    bearing = []
    for number in range(1, len(blades) + 1):
        stiffness = servo.number(f"PitSpr({number})", keys.NOT_NEGATIVE)
        damping = servo.number(f"PitDamp({number})", keys.NOT_NEGATIVE)
        bearing.append((stiffness, damping, servo.number(f"PitNeut({number})", _ANGLE)))
    return tuple(bearing)


# ElastoDyn's blades: mass on the pitch axis


def _elastodyn_blade(main: InputFile, structure: InputFile, number: int) -> BladeModel:
    """Return a blade whose mass properties are ElastoDyn's sums over the blade's nodes.

    Parameters
    ----------
    main, structure : the .fst file and ElastoDyn's primary file.
    number : number of the blade, from 1.

    Raises
    ------
    InputError
        If the blade has no mass.
    """
    tip_radius, hub_radius = structure.number("TipRad"), structure.number("HubRad")
    length = tip_radius - hub_radius
    file = structure.file(f"BldFile({number})", "an input file of an ElastoDyn blade")
    density = _mass_density(file)

    centres, widths, which = _nodes(main, structure, file, length)
    tip_mass = structure.number(f"TipMass({number})", keys.NOT_NEGATIVE)
    mass = tip_mass
    first = tip_mass * length
    second = tip_mass * length**2
    for centre, width in zip(centres, widths, strict=True):
        element = density(centre / length) * width
        mass += element
        first += element * centre
        second += element * centre**2
    if not mass >= keys.SMALLEST:
        raise file.problem("BMassDen", f"the blade's mass is {mass:g} kg", "a mass above 0")

    # OpenFAST uses the inertia about the pitch axis only if the pitch is free.
    pitch_inertia = 0.0
    if structure.flag("PitchDOF"):
        for name in ("PBrIner", "BlPIner"):
            pitch_inertia += structure.number(f"{name}({number})", keys.NOT_NEGATIVE, 0.0)
    across = second - first**2 / mass
    # With a single node it is 0, and rounding may make it negative.
    if across < 0.0:
        across = 0.0
    return BladeModel(
        source=f"ElastoDyn's sum over {which}",
        mass=mass,
        first_moment=first,
        second_moment=second,
        centre_of_mass=(0.0, 0.0, first / mass),
        inertia=(across, across, pitch_inertia, 0.0, 0.0, 0.0),
        tip=(0.0, 0.0, length),
        cone=structure.number(f"PreCone({number})", _CONE),
        pitch=structure.number(f"BlPitch({number})", _ANGLE),
        notes=_integral_note(file, length, tip_mass, mass, second),
    )


def _blade_table(file: InputFile) -> tuple[list[float], list[float]]:
    """Return fractions of the length and masses per length (kg/m) at the stations of a blade.

    The columns of the table differ between versions of the file. They are found by their names.

    Parameters
    ----------
    file : ElastoDyn's file of the blade.

    Raises
    ------
    InputError
        If the table is missing, fractions do not rise from 0 to 1, or a mass is negative.
    """
    count = file.whole("NBlInpSt", 2, MAX_ROWS)
    header = file.line_with("BlFract", "BMassDen")
    if header < 0:
        what = "no table with the columns BlFract and BMassDen"
        raise InputError(f"{shown_path(file.path)}: {what}; allowed: a blade file of ElastoDyn")
    at_fraction, at_density = table_columns(file, header, ("BlFract", "BMassDen"))
    rows = file.rows(header + 2, count, "station", max(at_fraction, at_density) + 1)
    fractions = [row[at_fraction] for row in rows]
    factor = file.number("AdjBlMs", keys.NOT_NEGATIVE)
    densities = [factor * row[at_density] for row in rows]
    for index, row in enumerate(rows):
        is_rising = index == 0 or fractions[index] > fractions[index - 1]
        if not is_rising or not 0.0 <= fractions[index] <= 1.0 or row[at_density] < 0.0:
            place = f"{shown_path(file.path)}:{header + 3 + index}"
            what = f"BlFract {fractions[index]:g}, BMassDen {row[at_density]:g}"
            allowed = "BlFract that rises from 0 to 1, BMassDen of at least 0"
            raise InputError(f"{place}: {what}; allowed: {allowed}")
    return fractions, densities


def _mass_density(file: InputFile) -> Callable[[float], float]:
    """Return the function that computes the mass per length, kg/m, at a fraction of the length.

    The function is linear between the stations.

    Parameters
    ----------
    file : ElastoDyn's file of the blade.
    """
    fractions, densities = _blade_table(file)

    def density(fraction: float) -> float:
        for left in range(len(fractions) - 1):
            if fraction <= fractions[left + 1] or left == len(fractions) - 2:
                width = fractions[left + 1] - fractions[left]
                share = min(max((fraction - fractions[left]) / width, 0.0), 1.0)
                return densities[left] + share * (densities[left + 1] - densities[left])
        return densities[-1]

    return density


def _nodes(
    main: InputFile,
    structure: InputFile,
    blade: InputFile,
    length: float,
) -> tuple[list[float], list[float], str]:
    """Return distances from the root and widths (m) of a blade's nodes, and a description.

    Parameters
    ----------
    main, structure, blade : the .fst file, ElastoDyn's primary file, and the blade's file.
    length : m, length of the blade.

    Raises
    ------
    InputError
        If the model has AeroDyn 14, and its file has no table of nodes.
    """
    # In older models a CompAero of 1 means AeroDyn 14, and ElastoDyn uses the nodes of AeroDyn 14.
    # Since OpenFAST 4 it means AeroDisk. Blade files of these versions have no column PitchAxis.
    is_old = blade.line_with("BlFract", "PitchAxis") >= 0
    if is_old and main.whole("CompAero", 0, 100, 0) == 1:
        aero = main.file("AeroFile", "an input file of AeroDyn 14")
        if aero.line_with("RNodes", "DRNodes") < 0:
            what = "no table with the columns RNodes and DRNodes"
            raise InputError(f"{shown_path(aero.path)}: {what}; allowed: a file of AeroDyn 14")
        return _aerodyn14_nodes(structure, aero, length)
    count = structure.whole("BldNodes", 1, MAX_NODES)
    width = length / count
    centres = [(index + 0.5) * width for index in range(count)]
    return centres, [width] * count, f"its {count} equal nodes"


def _aerodyn14_nodes(
    structure: InputFile, aero: InputFile, length: float
) -> tuple[list[float], list[float], str]:
    """Return distances from the root and widths (m) of AeroDyn 14's nodes, and a description.

    Parameters
    ----------
    structure, aero : the input files of ElastoDyn and AeroDyn 14.
    length : m, length of the blade.

    Raises
    ------
    InputError
        If the nodes are not in the middle of elements between HubRad and TipRad.
    """
    count = aero.whole("BldNodes", 1, MAX_NODES)
    header = aero.line_with("RNodes", "DRNodes")
    (at_radius,) = table_columns(aero, header, ("RNodes",))
    hub_radius = structure.number("HubRad")
    centres = []
    for row in aero.rows(header + 1, count, "node", at_radius + 1):
        centres.append(row[at_radius] - hub_radius)
    widths = [2.0 * centres[0]]
    for before, centre in pairwise(centres):
        widths.append(2.0 * (centre - before) - widths[-1])
    for index, (centre, width) in enumerate(zip(centres, widths, strict=True)):
        if not 0.0 < centre <= length or width <= 0.0:
            place = f"{shown_path(aero.path)}:{header + 2 + index}"
            what = f"RNodes {centre + hub_radius:g} m makes an element {width:.4g} m wide"
            allowed = "nodes in the middle of elements between HubRad and TipRad"
            raise InputError(f"{place}: {what}; allowed: {allowed}")
    return centres, widths, f"the {count} nodes of AeroDyn 14"


def _integral_note(
    file: InputFile,
    length: float,
    tip_mass: float,
    mass: float,
    second: float,
) -> tuple[str, ...]:
    """Return a note on the difference between the integral of the density and the node sum.

    Parameters
    ----------
    file : ElastoDyn's file of the blade.
    length : m, length of the blade.
    tip_mass : kg.
    mass, second : mass and second moment by the node sum, kg and kg m².

    Returns
    -------
    tuple of str
        The note; () if the relative differences are at most `_SHOWN_DIFFERENCE`.
    """
    fractions, densities = _blade_table(file)
    total, moment = tip_mass, tip_mass * length**2
    for left in range(len(fractions) - 1):
        a, b = fractions[left] * length, fractions[left + 1] * length
        mean = 0.5 * (densities[left] + densities[left + 1])
        at_middle = 0.25 * (a + b) ** 2 * mean
        total += (b - a) * mean
        # Simpson's rule is exact for the product of a linear density and a squared distance.
        ends = a**2 * densities[left] + b**2 * densities[left + 1]
        moment += (b - a) * (ends + 4.0 * at_middle) / 6.0
    by_mass, by_moment = total / mass - 1.0, moment / second - 1.0 if second else 0.0
    if max(abs(by_mass), abs(by_moment)) <= _SHOWN_DIFFERENCE:
        return ()
    differences = f"{100.0 * by_mass:+.2g} % in mass, {100.0 * by_moment:+.2g} % in second moment"
    return (f"The integral of the density table, which OpenFAST does not use: {differences}.",)


# BeamDyn's blades: sections along a curved axis


def _beamdyn_blade(main: InputFile, structure: InputFile, number: int) -> BladeModel:
    """Return a blade whose mass properties are integrals over BeamDyn's stations.

    The inertia of the blade's sections is included.

    Parameters
    ----------
    main, structure : the .fst file and ElastoDyn's primary file.
    number : number of the blade, from 1.

    Raises
    ------
    InputError
        If the blade has no mass.
    """
    file = main.file(f"BDBldFile({number})", "an input file of BeamDyn")
    sections = file.file("BldFile", "an input file of a BeamDyn blade")
    axis, twist = _reference_axis(file)
    fractions, matrices = _stations(sections)
    mass, moment, about_root = _mass_properties(axis, twist, fractions, matrices)
    if not mass >= keys.SMALLEST:
        raise sections.problem("station_total", "the blade has no mass", "a mass above 0")

    centre = moment / mass
    # The scene's x axis is OpenFAST's -y, and the scene's y axis is OpenFAST's x (downwind).
    to_scene = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    about_centre = to_scene @ (about_root - mass * _steiner(centre)) @ to_scene.T
    if structure.flag("PitchDOF"):
        about_centre[2, 2] += structure.number(f"PBrIner({number})", keys.NOT_NEGATIVE, 0.0)
    x, y, z = (float(coordinate) for coordinate in to_scene @ centre)
    xx, yy, zz = (float(about_centre[i, i]) for i in range(3))
    xy, xz, yz = float(about_centre[0, 1]), float(about_centre[0, 2]), float(about_centre[1, 2])
    tip_x, tip_y, tip_z = (float(coordinate) for coordinate in to_scene @ axis[-1])
    return BladeModel(
        source=f"integral over BeamDyn's {len(fractions)} stations",
        mass=mass,
        first_moment=float(moment[2]),
        # ∫ z² dm follows from the moments of inertia about the root.
        second_moment=float(0.5 * (about_root[0, 0] + about_root[1, 1] - about_root[2, 2])),
        centre_of_mass=(x, y, z),
        inertia=(xx, yy, zz, xy, xz, yz),
        tip=(tip_x, tip_y, tip_z),
        cone=structure.number(f"PreCone({number})", _CONE),
        pitch=structure.number(f"BlPitch({number})", _ANGLE),
    )


def _mass_properties(
    axis: NDArray[np.float64],
    twist: NDArray[np.float64],
    fractions: NDArray[np.float64],
    matrices: NDArray[np.float64],
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Integrate the mass of a blade over its reference axis, in OpenFAST's axes of the blade root.

    Parameters
    ----------
    axis, twist : (k, 3) m and (k,) degrees, reference axis and twist at the key points. Between
        these both are linear.
    fractions, matrices : (n,) and (n, 6, 6), see `_stations`.

    Returns
    -------
    float, ndarray, ndarray
        Mass, kg; first moment about the root, (3,) kg m; inertia about the root, (3, 3) kg m².
    """
    mass, moment, about_root = 0.0, np.zeros(3), np.zeros((3, 3))
    pieces = np.diff(axis, axis=0)
    lengths = np.sqrt((pieces**2).sum(axis=1))
    at_key_points = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    # Between two of these bounds the mass per length and the axis are linear. Gauss's rule with
    # three points is exact for the product of the mass per length and a squared distance.
    bounds = np.unique(np.concatenate([at_key_points, fractions]))
    bounds = bounds[(bounds >= fractions[0]) & (bounds <= fractions[-1])]
    points, weights = np.polynomial.legendre.leggauss(3)
    for left, right in pairwise(bounds):
        middle, half = 0.5 * (left + right), 0.5 * (right - left)
        piece = min(int(np.searchsorted(at_key_points, middle)) - 1, len(lengths) - 1)
        tangent = pieces[piece] / lengths[piece]
        for point, weight in zip(points, weights, strict=True):
            eta = middle + half * point
            ds = half * weight * lengths.sum()
            share = (eta - at_key_points[piece]) * lengths.sum() / lengths[piece]
            position = axis[piece] + share * pieces[piece]
            angle = twist[piece] + share * (twist[piece + 1] - twist[piece])
            turned = _section_axes(tangent, math.radians(angle))
            per_length, offset, inertia = _section(matrices, fractions, eta)
            # `inertia` is about the section's origin. It is converted to the section's centre of
            # mass (`own`), then to the root.
            centre = position + turned @ offset
            own = turned @ (inertia - per_length * _steiner(offset)) @ turned.T
            mass += per_length * ds
            moment += per_length * ds * centre
            about_root += ds * (own + per_length * _steiner(centre))
    return float(mass), moment, about_root


def _steiner(point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inertia, divided by the mass, of a point mass about the origin, (3, 3) m².

    Parameters
    ----------
    point : (3,) m, position of the point mass.
    """
    squared: NDArray[np.float64] = point @ point * np.eye(3) - np.outer(point, point)
    return squared


def _reference_axis(file: InputFile) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the key points of the reference axis, (k, 3) m, and the twists there, (k,) degrees.

    The key points are positions from the root in OpenFAST's axes.

    Parameters
    ----------
    file : BeamDyn's primary file.

    Raises
    ------
    InputError
        If the table is missing, or all key points are equal.
    """
    count = file.whole("kp_total", 2, MAX_ROWS)
    header = file.line_with("kp_xr", "kp_yr", "kp_zr", "initial_twist")
    if header < 0:
        what = "no table with the columns kp_xr, kp_yr, kp_zr and initial_twist"
        raise InputError(f"{shown_path(file.path)}: {what}; allowed: an input file of BeamDyn")
    rows = file.rows(header + 2, count, "key point", 4)
    table = np.array([row[:4] for row in rows])
    # The last key point of a member is repeated as the first of the next member.
    is_new = np.concatenate([[True], (np.diff(table[:, :3], axis=0) != 0.0).any(axis=1)])
    points, twists = table[is_new, :3], table[is_new, 3]
    if not (np.diff(points, axis=0) ** 2).sum() > 0.0:
        raise file.problem("kp_total", "all key points are one", "key points along the blade")
    return points, twists


def _stations(file: InputFile) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions and mass matrices of the stations of a blade of BeamDyn.

    Parameters
    ----------
    file : BeamDyn's file of the blade.

    Returns
    -------
    ndarray, shape (n,)
        Fractions of the length of the axis.
    ndarray, shape (n, 6, 6)
        Mass matrices.

    Raises
    ------
    InputError
        If the table is missing or incomplete, fractions do not rise, or a mass is negative.
    """
    count = file.whole("station_total", 2, MAX_ROWS)
    # The file may have damping blocks before the stations. These have rows of numbers, too, which
    # must be skipped.
    start = next((i for i, line in enumerate(file.lines) if _TABLE in line.upper()), -1)
    if start < 0:
        what = "no line with DISTRIBUTED PROPERTIES"
        raise InputError(f"{shown_path(file.path)}: {what}; allowed: a blade file of BeamDyn")
    filled = file.lines_of_numbers(start + 1)
    rows_each = 1 + 2 * _MATRIX_ROWS
    fractions, matrices = np.zeros(count), np.zeros((count, _MATRIX_ROWS, _MATRIX_ROWS))
    for station in range(count):
        lines = filled[station * rows_each : (station + 1) * rows_each]
        if len(lines) < rows_each:
            what = f"{station} stations and a part of one, station_total is {count}"
            raise file.problem("station_total", what, "as many as there are")
        fractions[station] = file.rows(lines[0], 1, "fraction of station", 1)[0][0]
        for row, index in enumerate(lines[1 + _MATRIX_ROWS :]):
            name = f"row {row + 1} of the mass matrix, row"
            matrices[station, row] = file.rows(index, 1, name, _MATRIX_ROWS)[0][:_MATRIX_ROWS]
        is_rising = station == 0 or fractions[station] > fractions[station - 1]
        if not is_rising or matrices[station, 0, 0] < 0.0:
            place = f"{shown_path(file.path)}:{lines[0] + 1}"
            what = f"station {station + 1} at {fractions[station]:g}"
            allowed = "fractions that rise, masses of at least 0"
            raise InputError(f"{place}: {what}; allowed: {allowed}")
    return fractions, matrices


def _section(
    matrices: NDArray[np.float64],
    fractions: NDArray[np.float64],
    eta: float,
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return the mass properties of a section of a blade.

    Parameters
    ----------
    matrices : (n, 6, 6) mass matrices at the stations. Between the stations they are linear.
    fractions : (n,) fractions of the length at which the stations are.
    eta : fraction of the length at which the section is.

    Returns
    -------
    float, ndarray, ndarray
        Mass per length, kg/m; centre of mass, (3,) m; inertia per length about the section's
        origin, (3, 3) kg m.
    """
    right = min(max(int(np.searchsorted(fractions, eta)), 1), len(fractions) - 1)
    share = (eta - fractions[right - 1]) / (fractions[right] - fractions[right - 1])
    matrix = (1.0 - share) * matrices[right - 1] + share * matrices[right]
    mass = float(matrix[0, 0])
    centre = np.array([matrix[1, 5], -matrix[0, 5], 0.0])
    centre = centre / mass if mass else np.zeros(3)
    return mass, centre, matrix[3:, 3:]


def _section_axes(tangent: NDArray[np.float64], twist: float) -> NDArray[np.float64]:
    """Return the axes of a section as columns, (3, 3), in OpenFAST's axes of the blade root.

    Parameters
    ----------
    tangent : (3,) unit tangent of the reference axis, which is the section's z axis.
    twist : rad, angle of the section's x axis, counted about -z.
    """
    x = np.array([math.cos(twist), -math.sin(twist), 0.0])
    x -= (x @ tangent) * tangent
    x /= math.sqrt(x @ x)
    return np.column_stack([x, np.cross(tangent, x), tangent])


# Properties of the model that no scene has


def _left_out(main: InputFile, structure: InputFile, elastic: int, count: int) -> list[str]:
    """Return texts about what the model has and no scene has, the most important first.

    Parameters
    ----------
    main, structure : the .fst file and ElastoDyn's primary file.
    elastic : CompElast.
    count : number of blades.
    """
    notes = []
    makes_motion = []
    if main.whole("CompAero", 0, 100, 0):
        makes_motion.append("aerodynamics")
    if main.whole("CompServo", 0, 100, 0):
        makes_motion.append("generator and controller torque")
    if makes_motion:
        rows = "rows [t, RtAeroMxh - GenTq*GBRatio] as torque.rotor stand for them"
        notes.append(f"{', '.join(makes_motion)}: they make the motion; {rows}")
    if not structure.flag("PitchDOF"):
        notes.append("commands of the pitch: it is prescribed; rows [t, -pitch] are bearing.rest")
    if not structure.flag("GenDOF", default=True):
        notes.append(
            "a prescribed speed (GenDOF False): a rotor in balance keeps its speed by itself"
        )
    if elastic == 2:
        notes.append("flexible blades (BeamDyn)")
    bending = ("FlapDOF1", "FlapDOF2", "EdgeDOF")
    is_flexible = elastic == 1 and any(map(structure.flag, bending))
    if is_flexible:
        notes.append(f"flexible blades ({_listed(structure, bending)})")
    if structure.flag("DrTrDOF"):
        notes.append("drive-train torsion (DrTrDOF): hub and generator are one body here")
    if count == 2 and structure.flag("TeetDOF"):
        notes.append("teeter (TeetDOF): the hub is rigid here")
    moving = (
        "YawDOF", "TwFADOF1", "TwFADOF2", "TwSSDOF1", "TwSSDOF2", "PtfmSgDOF", "PtfmSwDOF",
        "PtfmHvDOF", "PtfmRDOF", "PtfmPDOF", "PtfmYDOF",
    )  # fmt: skip
    if any(map(structure.flag, moving)):
        names = _listed(structure, moving)
        notes.append(
            f"motion of nacelle, tower or platform ({names}): the shaft's bearing rests here"
        )
    for name, effect in (("PtfmPitch", "tilt less it"), ("PtfmRoll", ""), ("TTDspFA", "")):
        value = structure.number(name, default=0.0)
        if value:
            advice = f": the shaft's own angle is {effect}" if effect else ""
            notes.append(f"an initial {name} of {value:g}{advice}")
    efficiency = structure.number("GBoxEff", default=100.0)
    if efficiency != 100.0:
        notes.append(f"gearbox efficiency {efficiency:g} %, which is friction: see shaft.damping")
    if structure.flag("Furling"):
        notes.append("furling")
    if main.whole("MHK", 0, 2, 0):
        notes.append("water (MHK): buoyancy and added mass")
    if main.whole("NRotors", 1, 100, 1) > 1:
        notes.append("more rotors (NRotors): this is the first one")
    if main.flag("MirrorRotor"):
        notes.append("MirrorRotor: the motion here is the mirror image, x reversed")
    return notes


def _listed(structure: InputFile, names: Sequence[str]) -> str:
    """Return the names of those flags that are True, joined by commas."""
    return ", ".join(name for name in names if structure.flag(name))
