"""Scenes of OpenFAST models: masses as OpenFAST prints them, every generation of files, what is
refused."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.commands import refusal, rotor_mbs
from support.openfast_models import (
    DENSITY,
    GENERATIONS,
    HUB_RADIUS,
    LENGTH,
    NODES,
    write_aerodyn14,
    write_beamdyn,
    write_model,
)  # fmt: skip

import rotor_mbs as rm
from rotor_mbs.errors import InputError
from rotor_mbs.scenario.openfast import read_rotor
from rotor_mbs.scenario.scene import Scene, load_scene, new_scene_text

# Public models, which are not in the repository.
MODELS = next(
    (
        one / "shared/turbines"
        for one in Path(__file__).parents
        if (one / "shared/turbines").is_dir()
    ),
    None,
)
TIP_MASS = 3.5


def masses_of(scene: Scene, blade: int = 0) -> dict[str, float]:
    """Mass of a blade, its moments about the root at the hub radius, and the rotor's inertia
    without the generator."""
    one, root = scene.blades[blade], scene.hub_radius
    z = one.centre_of_mass[2] - root
    total = scene.hub_inertia
    for each in scene.blades:
        about_apex = each.inertia[0] + each.mass * each.centre_of_mass[2] ** 2
        total += math.cos(each.cone) ** 2 * about_apex
    return {
        "mass": one.mass,
        "first": one.mass * z,
        "second": one.inertia[0] + one.mass * z**2,
        "cg": z,
        "rotor mass": scene.hub_mass + sum(each.mass for each in scene.blades),
        "rotor inertia": total,
    }


# Masses as OpenFAST prints them


@pytest.mark.skipif(MODELS is None, reason="the public models are not here")
@pytest.mark.parametrize(
    ("model", "summary"),
    [
        ("AOC/Test06.fst", "AOC/TstFiles/Test06.ED.sum"),
        ("AOC/Test08.fst", "AOC/TstFiles/Test08.ED.sum"),
        ("UAE/Test09.fst", "UAE/TstFiles/Test09.ED.sum"),
        ("UAE/Test10.fst", "UAE/TstFiles/Test10.ED.sum"),
        ("WP15/Test13.fst", "WP15/TstFiles/Test13.ED.sum"),
        ("NREL5MW_v8/Test18.fst", "NREL5MW_v8/TstFiles/Test18.ED.sum"),
    ],
)
def test_masses_of_the_written_scene_are_those_of_the_models_summary(
    tmp_path: Path, model: str, summary: str
) -> None:
    """FAST v8 printed three decimals of a sum in single precision, which its longest sums have to
    4e-7."""
    assert MODELS is not None
    assert rotor_mbs("new", tmp_path / "mine.toml", "--from", MODELS / model).status == 0
    scene = load_scene(tmp_path / "mine.toml")
    text = (MODELS / summary).read_text(encoding="latin-1")
    found = masses_of(scene)
    generator = tomllib.loads(scene.text)["hub"]["inertia"].rpartition(" + ")[2]
    inertia, _, ratio = generator.partition("*")
    found["rotor inertia"] -= float(inertia) * float(ratio.removesuffix("**2")) ** 2
    names = {
        "mass": "Mass",
        "first": "First Mass Moment",
        "second": "Second Mass Moment",
        "cg": "Center of Mass",
        "rotor mass": "Rotor Mass",
        "rotor inertia": "Rotor Inertia",
    }
    for key, name in names.items():
        printed = re.search(rf"^ +{name} +\(\S+\) +(\S+)", text, re.M)
        assert printed is not None
        assert found[key] == pytest.approx(float(printed[1]), rel=1e-6, abs=5.1e-4), key


@pytest.mark.skipif(MODELS is None, reason="the public models are not here")
@pytest.mark.parametrize(
    ("model", "printed"),
    [
        # OpenFAST/r-test: 5MW_Land_DLL_WTurb_wNacDrag.ED.sum (24-Jul-2024), MHK_RM1_Floating.ED.sum
        # (17-Oct-2023).
        (
            "NREL5MW/NREL-5MW/NREL-5MW.fst",
            (17536.614, 362132.653, 11752352.265, 20.650, 109389.842, 38677040.613),
        ),
        (
            "MHK_RM1/MHK_RM1/MHK_RM1_Floating.fst",
            (6257.858, 17304.874, 75372.157, 2.765, 12655.715, 232552.212),
        ),
    ],
)
def test_masses_are_those_of_openfasts_own_runs_to_the_last_digit(
    model: str, printed: tuple[float, ...]
) -> None:
    assert MODELS is not None
    rotor = read_rotor(MODELS / model)
    found = masses_of(rm.scene_from_openfast(MODELS / model))
    found["rotor inertia"] -= rotor.hub_inertia[1]
    assert tuple(found.values()) == pytest.approx(printed, rel=1e-12, abs=5.1e-4)
    assert rotor.inertia == pytest.approx(printed[-1], abs=5.1e-4)


@pytest.mark.skipif(MODELS is None, reason="the public models are not here")
def test_the_mass_of_a_beamdyn_blade_is_that_of_its_summary() -> None:
    """OpenFAST/r-test, 5MW_Land_BD_DLL_WTurb.BD1.sum: 16844.752 kg; its moments leave out the
    inertia of sections."""
    assert MODELS is not None
    scene = rm.scene_from_openfast(MODELS / "NREL5MW_v8_BD/Test26.fst")
    assert scene.blades[0].mass == pytest.approx(16844.752, abs=5.1e-4)
    assert scene.blades[0].centre_of_mass[2] - scene.hub_radius == pytest.approx(20.5073, rel=1e-3)
    assert scene.blades[0].pitch_inertia > 0.0


# Every generation of files, from numbers: the sum over equal nodes of a uniform line has a closed
# form


def node_sum() -> dict[str, float]:
    """The midpoint rule with N nodes: rho L, rho L²/2, rho L³/3 (1 - 1/4N²), and a mass at the
    tip."""
    line = DENSITY * LENGTH
    return {
        "mass": line + TIP_MASS,
        "first": line * LENGTH / 2.0 + TIP_MASS * LENGTH,
        "second": line * LENGTH**2 / 3.0 * (1.0 - 0.25 / NODES**2) + TIP_MASS * LENGTH**2,
    }


@pytest.mark.parametrize("blades", [2, 3])
@pytest.mark.parametrize("generation", GENERATIONS)
def test_every_generation_of_files(tmp_path: Path, generation: str, blades: int) -> None:
    encoding = "latin-1" if generation == "FAST v8" else "utf-8"
    scene = rm.scene_from_openfast(write_model(tmp_path, generation, blades, encoding=encoding))
    assert (scene.name, len(scene.blades), scene.gravity, scene.duration) == (
        "model",
        blades,
        9.81,
        20.0,
    )
    assert "90\u00b0" in scene.title
    found = masses_of(scene)
    for key, value in node_sum().items():
        assert found[key] == pytest.approx(value, rel=1e-13), key
    degree = math.pi / 180.0
    pitches = [-2.0 * number * degree for number in range(1, blades + 1)]
    assert scene.initial_angles == pytest.approx([30.0 * degree, *pitches], rel=1e-15)
    assert scene.initial_rates[0] == pytest.approx(0.4 * math.pi, rel=1e-15)
    assert (scene.shaft_tilt, scene.blades[0].cone) == pytest.approx(
        (-5.0 * degree, -2.5 * degree), rel=1e-15
    )
    assert (scene.hub_radius, scene.hub_mass) == (HUB_RADIUS, 400.0)
    assert scene.blades[0].tip == (0.0, 0.0, HUB_RADIUS + LENGTH)
    # Two blades: HubIner was about the teeter axis before it had a line of its own.
    is_about_teeter = blades == 2 and GENERATIONS.index(generation) < GENERATIONS.index(
        "OpenFAST 4.2"
    )
    hub = 1000.0 - (400.0 * 0.5**2 if is_about_teeter else 0.0)
    assert scene.hub_inertia == pytest.approx(hub + 2.5 * 30.0**2, rel=1e-15)
    if generation == "OpenFAST 5":
        assert scene.blades[0].pitch_inertia == pytest.approx(320.0, rel=1e-15)
        assert scene.bearings == [(5e5, 1e3)] * blades
        rests = [rest for _, rest in scene.pitch_loads]
        assert rests == [((0.0, pytest.approx(-4.0 * degree)),)] * blades
    else:
        assert not scene.blades[0].has_pitch_inertia
        assert scene.bearings == [(0.0, 0.0)] * blades


def test_nodes_of_aerodyn_14(tmp_path: Path) -> None:
    """Elements of 2, 4 and 2 m: one node in the middle of each."""
    radii = [HUB_RADIUS + distance for distance in (1.0, 4.0, 7.0)]
    path = write_model(tmp_path, "FAST v8", changes={"CompAero": "1"})
    write_aerodyn14(tmp_path, radii)
    blade = read_rotor(path).blades[0]
    widths, centres = np.array([2.0, 4.0, 2.0]), np.array([1.0, 4.0, 7.0])
    for power, found in enumerate((blade.mass, blade.first_moment, blade.second_moment)):
        assert found == pytest.approx(
            DENSITY * widths @ centres**power + TIP_MASS * LENGTH**power, rel=1e-14
        )
    # Since OpenFAST 4 the same number means AeroDisk, whose file is not needed.
    path = write_model(tmp_path / "new", "OpenFAST 4.2", changes={"CompAero": "1"})
    assert f"{NODES} equal nodes" in read_rotor(path).blades[0].source


def test_a_blade_of_beamdyn_is_a_rod_with_offsets(tmp_path: Path) -> None:
    """A straight rod that leans: mass on a line parallel to its axis, turned about it by the
    twist."""
    mu, twist = 11.0, 30.0
    offset, own = np.array([0.3, -0.2, 0.0]), np.diag([0.7, 0.5, 1.2])
    # Inertia about the section's origin; products of a symmetric section are zero about its centre
    # of mass.
    about_origin = own + mu * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, 3:] = mu * np.eye(3), about_origin
    matrix[1, 5] = matrix[5, 1] = mu * offset[0]
    matrix[0, 5] = matrix[5, 0] = -mu * offset[1]
    end = np.array([1.0, 0.0, 8.0])
    points = [
        [0.0, 0.0, 0.0],
        (0.3 * end).tolist(),
        (0.3 * end).tolist(),
        (0.6 * end).tolist(),
        end.tolist(),
    ]
    write_beamdyn(tmp_path, points, twist, matrix.tolist())
    changes = {"CompElast": "2", "BDBldFile(1)": '"beam.dat"'}
    rotor = read_rotor(write_model(tmp_path, "OpenFAST 3.1", 1, changes))
    blade = rotor.blades[0]

    length = math.sqrt(end @ end)
    z = end / length
    # Section axes: z along the rod; x turned by the twist about -z from the plane of x and z.
    x0 = np.array([z[2], 0.0, -z[0]])
    y0 = np.cross(z, x0)
    # The direction of x seen along the blade is (cos, -sin) of the twist; along the leaning rod:
    seen = np.array([math.cos(math.radians(twist)), -math.sin(math.radians(twist)), 0.0])
    x = seen - seen @ z * z
    x /= math.sqrt(x @ x)
    axes = np.column_stack([x, np.cross(z, x), z])
    assert x @ x0 == pytest.approx(math.cos(math.radians(twist)), abs=5e-3)
    assert x @ y0 < 0.0
    centre = 0.5 * end + axes @ offset
    rod = (
        mu * length * (length**2 / 12.0 * (np.eye(3) - np.outer(z, z)))
        + length * axes @ own @ axes.T
    )
    to_scene = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    expected = to_scene @ rod @ to_scene.T
    assert blade.mass == pytest.approx(mu * length, rel=1e-13)
    assert blade.centre_of_mass == pytest.approx(to_scene @ centre, rel=1e-12)
    found = np.array([blade.inertia[i] for i in (0, 3, 4, 3, 1, 5, 4, 5, 2)]).reshape(3, 3)
    assert found == pytest.approx(expected, rel=1e-11, abs=1e-10)
    assert blade.tip == pytest.approx(to_scene @ end)
    # Its pitch is a coordinate that the model prescribes: a spring holds it at the model's pitch.
    scene = rm.scene_from_openfast(tmp_path / "model.fst")
    (stiffness, _), (_, rest) = scene.bearings[0], scene.pitch_loads[0]
    assert math.sqrt(stiffness / scene.blades[0].pitch_inertia) == pytest.approx(10.0 * math.pi)
    assert rest == ((0.0, pytest.approx(-math.radians(2.0))),)


def test_different_blades_have_tables_of_their_own(tmp_path: Path) -> None:
    scene = rm.scene_from_openfast(
        write_model(tmp_path, changes={"TipMass(2)": "70", "PreCone(3)": "4"})
    )
    masses = [blade.mass for blade in scene.blades]
    assert masses == pytest.approx([103.5, 170.0, 103.5])
    assert [math.degrees(blade.cone) for blade in scene.blades] == pytest.approx([-2.5, -2.5, 4.0])


def test_what_the_model_has_and_a_scene_has_not_is_said_most_important_first(
    tmp_path: Path,
) -> None:
    rotor = read_rotor(write_model(tmp_path, changes={"GenDOF": "False", "CompServo": "0"}))
    words = [note.split()[0] for note in rotor.left_out]
    assert words == ["aerodynamics:", "commands", "a", "flexible", "gearbox"]
    text = rm.scene_from_openfast(tmp_path / "model.fst").text
    comments = " ".join(" ".join(re.findall(r"^# (.*)", text, re.M)).split())
    places = [comments.index(note) for note in rotor.left_out]
    assert places == sorted(places)


def test_a_description_is_any_text(tmp_path: Path) -> None:
    """It is the title: of control characters, marks of direction and 300 words what a title may
    have."""
    path = write_model(tmp_path)
    lines = path.read_bytes().split(b"\r\n")
    lines[1] = 'a\x07b \u202e\u2028 \u00ad\x85 c"\\ '.encode() + b"word " * 300
    path.write_bytes(b"\r\n".join(lines))
    assert rm.scene_from_openfast(path).title.startswith('model: a b c"\\ word word')


# What is refused


V5 = {"PBrIner(1)": "0", "BlPIner(1)": "0"}
WRONG = [
    # generation, changes, file and name of the line that the message is about, the message
    (
        "OpenFAST 4.2",
        {"TipRad": "ten"},
        "ElastoDyn.dat",
        "TipRad",
        "'ten' is not a number; allowed: a number",
    ),
    (
        "OpenFAST 4.2",
        {"HubRad": "1,5"},
        "ElastoDyn.dat",
        "HubRad",
        "2 values, '1, 5'; allowed: a number of at least 0, with a decimal point",
    ),
    (
        "OpenFAST 4.2",
        {"NumBl": "3;1"},
        "ElastoDyn.dat",
        "NumBl",
        "2 values, '3, 1'; allowed: a number, with a decimal point",
    ),
    ("OpenFAST 4.2", {"TipRad": ""}, "ElastoDyn.dat", "", "no line named TipRad; allowed: "),
    (
        "OpenFAST 4.2",
        {"TipRad": "1e999"},
        "ElastoDyn.dat",
        "TipRad",
        "inf is out of range; allowed: ",
    ),
    (
        "OpenFAST 4.2",
        {"HubRad": "10"},
        "ElastoDyn.dat",
        "HubRad",
        "10 m leaves no blade; allowed: a number below",
    ),
    (
        "OpenFAST 4.2",
        {"NumBl": "4"},
        "ElastoDyn.dat",
        "NumBl",
        "4 is not allowed; allowed: a whole number from 1 to 3",
    ),
    (
        "OpenFAST 4.2",
        {"BldNodes": "1e9"},
        "ElastoDyn.dat",
        "BldNodes",
        "1e+09 is not allowed; allowed: ",
    ),
    (
        "OpenFAST 4.2",
        {"AdjBlMs": "0", "TipMass(1)": "0"},
        "blade.dat",
        "",
        "BMassDen: the blade's mass is 0 kg; ",
    ),
    (
        "OpenFAST 4.2",
        {"NBlInpSt": "4"},
        "blade.dat:12",
        "",
        "station 4 of 4 is not 3 numbers; allowed: ",
    ),
    ("OpenFAST 4.2", {"EDFile": '"nowhere.dat"'}, "model.fst", "EDFile", "no such file; allowed: "),
    ("OpenFAST 4.2", {"CompElast": "3"}, "model.fst", "CompElast", "3, Simplified ElastoDyn: "),
    (
        "OpenFAST 4.2",
        {"GenDOF": "maybe"},
        "ElastoDyn.dat",
        "GenDOF",
        "'maybe' is not a flag; allowed: True or False",
    ),
    (
        "OpenFAST 4.2",
        {"GBRatio": "1e300"},
        "ElastoDyn.dat",
        "GBRatio",
        "1e+300 is out of range; allowed: 0, or sizes",
    ),
    ("OpenFAST 4.2", {"TipRad": "1e14"}, "model.fst", "", "of the scene made of it: "),
    (
        "OpenFAST 5",
        V5,
        "ElastoDyn.dat",
        "PitchDOF",
        "True, and blade 1 has no inertia about its pitch axis; ",
    ),
    ("OpenFAST 5", {"PitSpr(2)": ""}, "ServoDyn.dat", "", "no line named PitSpr(2); allowed: "),
    (
        "FAST v8",
        {"CompAero": "1"},
        "model.fst",
        "AeroFile",
        "no such file; allowed: an input file of AeroDyn 14",
    ),
]


@pytest.mark.parametrize(("generation", "changes", "file", "name", "message"), WRONG)
def test_one_line_with_file_line_and_name(
    tmp_path: Path, generation: str, changes: dict[str, str], file: str, name: str, message: str
) -> None:
    path = write_model(tmp_path, generation, changes=changes)
    with pytest.raises(InputError) as caught:
        rm.scene_from_openfast(path)
    problem = caught.value.problems[0]
    assert message in problem
    if name:
        (found,) = tmp_path.rglob(file)
        lines = found.read_text(encoding="utf-8").splitlines()
        number = next(i for i, line in enumerate(lines, 1) if f" {name}\t" in line)
        assert f"{file}:{number}: {name}: " in problem
    else:
        assert f"{file}: {message}" in problem


def test_a_decimal_comma_in_a_table_is_refused_and_commas_between_columns_are_not(
    tmp_path: Path,
) -> None:
    model = write_model(tmp_path)
    (blade,) = tmp_path.rglob("blade.dat")
    written, plain = blade.read_bytes(), rm.scene_from_openfast(model).text
    *lines, first, second, third = written.split(b"\r\n")
    with_commas = [row.replace(b"  ", b",") for row in (first, second, third)]
    blade.write_bytes(b"\r\n".join([*lines, *with_commas]))
    assert rm.scene_from_openfast(model).text == plain
    blade.write_bytes(written.replace(b"13.3", b"13,3"))
    with pytest.raises(InputError, match=r"blade.dat:\d+: station 1 of 3 is not \d numbers"):
        rm.scene_from_openfast(model)


@pytest.mark.parametrize(
    "content", [b"", b"\x00\xff" * 100, "TipRad\n".encode("utf-16"), b"1 CompElast -\n" * 3]
)
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.fst"
    path.write_bytes(content)
    assert "other.fst: no line named" in refusal("new", tmp_path / "new.toml", "--from", path)


# The command


def test_new_writes_the_scene_and_a_mapping_and_replaces_neither(tmp_path: Path) -> None:
    model, scene = write_model(tmp_path), tmp_path / "mine.toml"
    ended = rotor_mbs("new", scene, "--from", model)
    assert ended.status == 0
    assert (
        "3 blades: 103.500 kg, cone -2.5 deg; ElastoDyn's sum over its 5 equal nodes" in ended.out
    )
    mapping = tmp_path / "mine.columns.toml"
    assert scene.read_text(encoding="utf-8") == rm.scene_from_openfast(model).text
    assert tomllib.loads(mapping.read_text())["program"] == "openfast"
    assert "File exists" in refusal("new", scene, "--from", model)
    scene.unlink()
    assert "mine.columns.toml: cannot be created" in refusal("new", scene, "--from", model)
    assert not scene.exists()
    # A folder's scenes are its TOML files but for the mappings.
    (tmp_path / "scenes").mkdir()
    mapping.rename(tmp_path / "scenes" / mapping.name)
    scene.write_text(new_scene_text(), encoding="utf-8")
    scene.rename(tmp_path / "scenes" / scene.name)
    assert rotor_mbs("show", tmp_path / "scenes").status == 0


def test_new_writes_no_file_that_run_would_refuse_for_its_name(tmp_path: Path) -> None:
    """Shipped scenes are in the folder turbine, so that results files have a group of this name."""
    for name in ("turbine.toml", "sweep.toml", ".hidden.toml", "my rotor.toml"):
        path = tmp_path / name
        assert "allowed: " in refusal("new", path)
        assert not path.exists()


def test_new_copies_a_scene_with_its_comments(tmp_path: Path) -> None:
    copy, second = tmp_path / "mine.toml", tmp_path / "again.toml"
    assert rotor_mbs("new", copy, "--from", "paper/fig11").status == 0
    text = copy.read_text(encoding="utf-8")
    assert text.startswith("# Aguilar-Acevedo")
    assert load_scene(copy).rotor_key == rm.scene("paper/fig11").rotor_key
    copy.write_text(text + "# mine\n", encoding="utf-8")
    assert rotor_mbs("new", second, "--from", copy).status == 0
    assert second.read_text(encoding="utf-8").endswith("# mine\n")
    assert "17 scenes" in refusal("new", tmp_path / "x.toml", "--from", "paper")
    assert "neither a scene nor an OpenFAST model" in refusal(
        "new", tmp_path / "x.toml", "--from", __file__
    )
    assert "no such scene, perhaps paper/fig12" in refusal(
        "new", tmp_path / "x.toml", "--from", "paper/fig1z"
    )
