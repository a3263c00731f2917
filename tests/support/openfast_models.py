"""Small OpenFAST models written from numbers: a uniform blade, in the form of each generation of
files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

# What distinguishes the generations: where gravity stands, columns of blade files, lines that came
# later.
GENERATIONS = ("FAST v8", "OpenFAST 2", "OpenFAST 3.1", "OpenFAST 4.2", "OpenFAST 5")
LENGTH, HUB_RADIUS, DENSITY, NODES = 8.0, 2.0, 12.5, 5


def write_model(
    folder: Path,
    generation: str = "OpenFAST 4.2",
    blades: int = 3,
    changes: Mapping[str, str] | None = None,
    encoding: str = "utf-8",
) -> Path:
    """Write a model of a rotor with uniform blades.

    Parameters
    ----------
    folder : for its files; blade files are in a folder beside.
    generation : one of `GENERATIONS`.
    blades : number of blades.
    changes : values in place of the usual ones, by the name of the line; "" leaves the line out.
    encoding : of the files.

    Returns
    -------
    Path
        Of the .fst file.
    """
    age = GENERATIONS.index(generation)
    changed = dict(changes or {})
    main: list[tuple[str, str]] = [
        ("20", "TMax"),
        ("0.01", "DT"),
        ("1", "CompElast"),
        ("0", "CompInflow"),
        ("2", "CompAero"),
        ("1", "CompServo"),
    ]
    if age == 4:
        main += [("1", "NRotors"), ("F T", "MirrorRotor")]
    if age >= 2:
        main += [("0", "MHK"), ("9.81", "Gravity")]
    main += [
        ('"parts\\ElastoDyn.dat"', "EDFile"),
        ('"unused"', "BDBldFile(1)"),
        ('"missing/wind.dat"', "InflowFile"),
        ('"missing/aero.dat"', "AeroFile"),
        ('"parts/ServoDyn.dat"', "ServoFile"),
        ("30, 60", "LinTimes"),
    ]

    structure: list[tuple[str, str]] = []
    if age < 2:
        structure += [("9.81", "Gravity")]
    structure += [("True", "FlapDOF1"), ("False", "EdgeDOF")]
    if age == 4:
        structure += [("True", "PitchDOF")]
    structure += [("True", "GenDOF"), ("False", "TeetDOF")]
    structure += [(str(2 * number), f"BlPitch({number})") for number in (1, 2, 3)]
    structure += [("40", "Azimuth"), ("12", "RotSpeed"), (str(blades), "NumBl")]
    structure += [(repr(HUB_RADIUS + LENGTH), "TipRad"), (repr(HUB_RADIUS), "HubRad")]
    structure += [("-2.5", f"PreCone({number})") for number in (1, 2, 3)]
    structure += [
        ("0.25", "HubCM"),
        ("0.75", "UndSling"),
        ("10", "AzimB1Up"),
        ("1.5", "ShftGagL"),
        ("-5", "ShftTilt"),
    ]
    structure += [("3.5", f"TipMass({number})") for number in (1, 2, 3)]
    if age == 4:
        structure += [("20", f"PBrIner({number})") for number in (1, 2, 3)]
        structure += [("300", f"BlPIner({number})") for number in (1, 2, 3)]
    structure += [("400", "HubMass"), ("1D3", "HubIner")]
    if age >= 3:
        structure += [("0", "HubIner_Teeter")]
    structure += [("2.5", "GenIner"), (str(NODES), "BldNodes")]
    # Written as on Windows, and without brackets in newer files.
    name = "BldFile{}" if age >= 3 else "BldFile({})"
    structure += [
        ('"..\\blades of steel\\blade.dat"', name.format(number)) for number in range(1, blades + 1)
    ]
    structure += [('"missing.dat"', name.format(number)) for number in range(blades + 1, 4)]
    structure += [("97.5", "GBoxEff"), ("30", "GBRatio"), (".false.", "Furling"), ("OutList", "")]

    blade: list[tuple[str, str]] = [("3", "NBlInpSt"), ("1.25", "AdjBlMs")]
    servo: list[tuple[str, str]] = [("5", "PCMode")]
    servo += [("4", f"PitNeut({number})") for number in (1, 2, 3)]
    servo += [("5D5", f"PitSpr({number})") for number in (1, 2, 3)]
    servo += [("1E3", f"PitDamp({number})") for number in (1, 2, 3)]

    (folder / "parts").mkdir(parents=True, exist_ok=True)
    (folder / "blades of steel").mkdir(exist_ok=True)
    files = {
        folder / "model.fst": _lines(f"{generation} file", main, changed),
        folder / "parts" / "ElastoDyn.dat": [
            *_lines("ElastoDyn", structure, changed),
            '"TipRad"  a channel',
        ],
        folder / "parts" / "ServoDyn.dat": _lines("ServoDyn", servo, changed),
        folder / "blades of steel" / "blade.dat": [
            *_lines("a blade", blade, changed),
            *_table(age < 3),
        ],
    }
    for path, lines in files.items():
        path.write_bytes("\r\n".join(lines).encode(encoding))
    return folder / "model.fst"


def _lines(title: str, entries: Sequence[tuple[str, str]], changes: Mapping[str, str]) -> list[str]:
    """Return the lines of a file: two of text, then value, name and comment, separated by tabs and
    blanks."""
    lines = [
        f"------- {title} INPUT FILE -------",
        "An unbalanced rotor, 90\u00b0 of TipRad",
        "------- PART -------",
    ]
    for value, name in entries:
        given = changes.get(name, value)
        if given:
            lines.append(f"\t{given}   {name}\t- Comment on GenIner and others (kN\u00b7m)")
    return lines


def _table(has_pitch_axis: bool) -> list[str]:
    """Return the table of a uniform blade of DENSITY/1.25 kg/m, with or without the column that
    older files have."""
    lines = ["---- DISTRIBUTED BLADE PROPERTIES ----"]
    names, units = (
        ["BlFract", "StrcTwst", "BMassDen", "FlpStff"],
        ["(-)", "(deg)", "(kg/m)", "(Nm^2)"],
    )
    if has_pitch_axis:
        names.insert(1, "PitchAxis")
        units.insert(1, "(-)")
    lines += ["  ".join(names), "  ".join(units)]
    for fraction in ("0.0D+00", "0.25", "1."):
        row = [fraction, "13.3", repr(DENSITY / 1.25), "1E9"]
        if has_pitch_axis:
            row.insert(1, "0.25")
        lines.append("  ".join(row))
    return lines


def write_aerodyn14(folder: Path, radii: Sequence[float]) -> None:
    """Write the file of AeroDyn 14 that the model names, with nodes at these radii from the apex,
    m."""
    lines = ["AeroDyn v14 INPUT FILE", "text", f"{len(radii)}  BldNodes - nodes"]
    lines += ["RNodes  AeroTwst  DRNodes  Chord  NFoil  PrnElm"]
    lines += [f"{radius!r} 0.0 9.9 1.0 1 NOPRINT" for radius in radii]
    (folder / "missing").mkdir(exist_ok=True)
    (folder / "missing" / "aero.dat").write_text("\n".join(lines))


def write_beamdyn(
    folder: Path,
    points: Sequence[Sequence[float]],
    twist: float,
    matrix: Sequence[Sequence[float]],
) -> None:
    """Write the files of a BeamDyn blade with equal sections.

    Parameters
    ----------
    folder : for the files.
    points : (n, 3) key points, m.
    twist : deg.
    matrix : (6, 6), of mass.
    """
    lines = [
        "BEAMDYN INPUT FILE",
        "text",
        "--- GEOMETRY ---",
        "1 member_total - members",
        f"{len(points)} kp_total -",
    ]
    lines += [
        f"1 {len(points)} - Member number; Number of key points",
        "kp_xr kp_yr kp_zr initial_twist",
        "(m) (m) (m) (deg)",
    ]
    lines += [f"{x!r} {y!r} {z!r} {twist!r}" for x, y, z in points]
    lines += ['"blade.bd"  BldFile - properties']
    (folder / "beam.dat").write_text("\n".join(lines))
    lines = [
        "BEAMDYN INDIVIDUAL BLADE INPUT FILE",
        "text",
        "3 station_total - stations",
        "1 damp_type - damping",
    ]
    lines += [
        "--- DAMPING ---",
        "mu1 mu2 mu3 mu4 mu5 mu6",
        "(-) (-) (-) (-) (-) (-)",
        "0.01 0.01 0.01 0.01 0.01 0.01",
    ]
    lines += ["--- DISTRIBUTED PROPERTIES ---"]
    stiffness = "\t1E9 -0.0 0.0 0.0 0.0 0.0"
    for fraction in ("0.0", "0.3", "1.0"):
        lines += [f" {fraction}", *[stiffness] * 6, ""]
        lines += ["\t".join(map(repr, row)) for row in matrix]
        lines += ["! the next station"]
    (folder / "blade.bd").write_text("\n".join(lines))
