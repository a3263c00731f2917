"""Every text of the report, in Spanish: the names of `texts`, and what they say to the paper's readers.

Numbers are written as the paper writes them, with a decimal point. What a results file brings with it (messages of
methods, scene files) stays in the language it was written in.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING

from rotor_mbs.analysis.methods import model_of
from rotor_mbs.analysis.summary import Agreement, Finding, PrintedEnergy, Reproduced, Tally
from rotor_mbs.report.names import NAMES, name_of
from rotor_mbs.report.numbers import number, prefixed, quantity

if TYPE_CHECKING:
    from rotor_mbs.report.walk_facts import Facts

LANGUAGE = "es"
REPORT = "Informe del rotor"
TITLE = "Un modelo de rotor publicado frente a los correctos"
TITLE_PLAIN = "Escenas de un rotor por modelos independientes"
ERRATA_TITLE = "Erratas de las ecuaciones impresas"
PAPER = (
    "Aguilar-Acevedo et al., Modelado Euler-Lagrange del rotor de un aerogenerador tripala como sistema multicuerpo, "
    "Revista UIS Ingenierías 19(1), 25-36, 2020, doi 10.18273/revuin.v19n1-2020002"
)

# Headings
FINDING = "El resultado"
SCENES = "Escenas"
NUMBERS = "Números publicados"
CLAIMS = "Afirmaciones publicadas"
CONDITIONS = "Lo que el artículo no imprime"
MACHINE = "Hecho con"
PAPER_SAYS = "Lo que dice el artículo"
MOTION = "Ángulos y velocidades"
DIFFERENCE = "Diferencia con la referencia"
ENERGY = "Energía"
PATHS = "Trayectorias de las puntas"
METRICS = "Los métodos en números"
SCENE_FILE = "Archivo de la escena"
ENTRIES = "Elementos comprobados"
EFFECTS = "Lo que cada errata por sí sola hace a cada escena"

# The viewer
MOVING = "El rotor en movimiento"
PLAY, PAUSE, TIME, SPEED, MODELS, VIEW = "Reproducir", "Pausa", "Tiempo", "Velocidad", "Modelos", "Vista"
SIDE_BY_SIDE, OVERLAID = "uno junto al otro", "superpuestos"
OFFSET_DRAWN = "Desplazamiento dibujado"
ENDED_AT, DASHED = "terminó a", "a trazos"
VIEWS = {"oblique": "Oblicua", "front": "Frente", "side": "Lado", "top": "Arriba"}
VIEWER_KEYS = (
    "Arrastre la imagen, o use en ella las teclas de flecha, para girar la vista; la barra espaciadora reproduce, coma "
    "y punto avanzan imagen por imagen."
)
VIEWER_OFFSET = (
    "La punta y el centro de masa están tan cerca del eje de la pala que su giro no se vería: su distancia al eje, y "
    "con ella las trayectorias, se dibujan aumentadas por el factor indicado (1 es a escala)."
)
METHOD_NAMES = NAMES | {
    "printed/ode45": "como se imprimió, ode45",
    "printed_e1/ode45": "solo E1, ode45",
    "printed_e2/ode45": "solo E2, ode45",
    "printed_e3/ode45": "solo E3, ode45",
    "lagrange/taylor": "forma cerrada, Taylor",
    "lagrange/ode45": "forma cerrada, Dormand-Prince 5(4)",
    "lagrange/dop853": "forma cerrada, DOP853",
    "lagrange/radau": "forma cerrada, Radau",
    "exudyn_tree/rk44": "Exudyn árbol, RK44",
    "exudyn_tree/rk67": "Exudyn árbol, RK67",
    "exudyn_tree/dopri5": "Exudyn árbol, DOPRI5",
    "exudyn_tree/generalized_alpha": "Exudyn árbol, α generalizado",
    "exudyn_chain/generalized_alpha": "Exudyn cadena, α generalizado",
    "exudyn_chain/newmark_index2": "Exudyn cadena, Newmark índice 2",
    "reference": "referencia, precisión cuádruple",
}

# The walk through the paper's figures
WALK, FIGURES, FIGURE_TITLES = "Las figuras del artículo, una por una", "Figuras", {
    "motion": "posición y velocidad", "paths": "trayectorias de las puntas", "torques": "torque constante en el rotor",
}  # fmt: skip
WALK_LEAD = (
    "Cada figura del artículo en su propia disposición: las ecuaciones como se imprimieron, integradas con ode45 como "
    "en el artículo, junto al modelo correcto y a Exudyn. Cada imagen tiene sus propias escalas, y lo que se escapa de "
    "ellas se corta; igual quiere decir dentro de 0.05 rad."
)
EXUDYN_COLUMN = "Exudyn"
PART_A, PART_B = "(a) posición", "(b) velocidad angular"
FIGURE_NOTES = {
    "6": "El pie de figura imprime π/10 rad/s, el texto 1/10; se dibuja lo del pie.",
    "13": "El texto toma el panel (b) por la corrida de la Fig. 12 (pala 1 a π/5 rad/s), el pie imprime π/8; se dibuja "
    "lo del pie.",
    "14": "Leído del PDF, el pie da tres pares de condiciones para cuatro paneles: qué par es de qué panel no es "
    "seguro, y la condición del panel (d) no se conoce. Para él no se dibuja nada.",
    "15": "El pie de la Fig. 16 imprime 1 y 100 kN·m; los demás torques del artículo no se conocen, 10 y 50 kN·m "
    "fueron elegidos.",
}
DOWNLOADS_NOTE = (
    "SVG y PNG: la imagen a tamaño de impresión, 132 mm de ancho, el PNG con 600 puntos por pulgada. Figuras enteras "
    "para un manuscrito, en PDF, SVG o PNG: rotor-mbs figures."
)

# Navigation
INDEX = "Todas las escenas"
ERRATA = "Erratas"
NAVIGATION = "Páginas"
PREVIOUS = "Escena anterior"
NEXT = "Escena siguiente"

# Axes
TIME_AXIS = "tiempo (s)"
ANGLE_AXIS = "ángulo (rad)"
ROTOR_AXIS = "ángulo del rotor (rad)"
RATE_AXIS = "velocidad (rad/s)"
DIFFERENCE_AXIS = "mayor diferencia de ángulo (rad)"
ENERGY_ERROR_AXIS = "error de energía (J)"
ENERGY_ERROR_RELATIVE_AXIS = "error de energía / escala de energía"
ALONG_SHAFT_AXIS = "y de la punta (mm)"

# Legends
CARRIED = "redondeo de un double al inicio, crecido"
UNCERTAINTY = "incertidumbre de la referencia"
HORIZON = "horizonte"
KINETIC, POTENTIAL, TOTAL = "cinética", "potencial", "total menos trabajo"
WIRE_START, WIRE_END, SHAFT = "pala al inicio", "pala al final", "eje"

# Words in tables
SCENE, FIGURE, METHOD, STATUS, COORDINATE, BLADE = "Escena", "Figura", "Método", "Estado", "Coordenada", "Pala"
HORIZON_COLUMN = "Horizonte"
REPRODUCED, NOT_REPRODUCED, HOLDS, HOLDS_NOT, UNDECIDED = (
    "reproducido",
    "no reproducido",
    "se cumple",
    "no se cumple",
    "–",
)
YES, NO = "sí", "no"
PRINTED_COLUMN = "Como se imprimió"
RIGHT_COLUMN = "Modelo correcto"
STATUSES = {
    "ok": "ok",
    "inaccurate": "inexacto",
    "diverged": "divergió",
    "singular": "singular",
    "solver_failed": "falló el integrador",
    "timed_out": "tiempo agotado",
}
NEVER_LEFT = "conservado"

HORIZON_NOTE = (
    "Horizonte: hasta entonces un error del estado inicial ha crecido menos de 100 000 veces; más allá, dos soluciones "
    "correctas pueden separarse sin culpa propia. Los errores hasta el horizonte son sobre todas las muestras antes de "
    "él. La deriva de energía es el mayor cambio de la energía total menos el trabajo, relativo a la escala de energía "
    "de la escena (pesos por sus brazos, energía inicial, trabajo del torque)."
)
QUOTE_NOTE = (
    "Los números se leen en los puntos de salida del propio integrador, como en una figura impresa, y se comparan en "
    "los dígitos impresos."
)
MATCHED = "una duración de la corrida y un orden de sumar los pesos elegidos para que coincidan"
GROWN_ROUNDING = "error de redondeo crecido"
MATCHED_NOTE = f"Estos números son {GROWN_ROUNDING}; salen con {MATCHED}."
ERRATA_LEAD = (
    "Por la definición del propio artículo las matrices impresas U, (8), (9) y (16) a (19), son las derivadas primeras "
    "y segundas de su transformación (3) respecto de los ángulos; los términos de masa, de velocidad y de gravedad se "
    "siguen de la misma transformación por las ecuaciones de Lagrange. Cada elemento impreso se comparó, en estados al "
    "azar, con lo que así se sigue de (3). Corregidas las erratas de abajo, las ecuaciones impresas son las "
    "ecuaciones de Euler-Lagrange correctas del rotor."
)
EFFECTS_NOTE = (
    "Las ecuaciones correctas con una sola errata, integradas con ode45 a las tolerancias del artículo, frente a la "
    "referencia. E3 sola no cambia nada: donde E2 está corregida, el coeficiente de sus términos es cero. Tampoco E2 "
    "donde todas las palas parten de cero, pues sin E1 ahí se quedan. Esas columnas muestran el error del integrador."
)
PATHS_NOTE = "Escalas iguales en las tres direcciones. Las palas son líneas del buje a la punta."


# Captions
SCENES_CAPTION = (
    "Los errores de ángulo son los mayores hasta el horizonte, frente a la referencia en precisión cuádruple"
)
ERRATA_CAPTION = "Las faltas en las ecuaciones impresas; todo lo demás se sigue de ellas"
DIFFERENCE_CAPTION = "Mayor diferencia con la referencia, entre todos los ángulos"
ENERGY_ERROR_CAPTION = "Error de energía de cada método"
EXTREMES_CAPTION = "Extremos"
ROTOR_ALONE = "Solo el ángulo del rotor"
ENDED_EARLY_NOTE = "juzgado por lo que hay: la corrida terminó antes de tiempo en"

# Columns
IN_THE_PAPER, PRINTED, RIGHT, VERDICT, ALSO_RIGHT = (
    "En el artículo", "Impreso", "Correcto", "Veredicto", "¿También el correcto?"
)  # fmt: skip
WHERE, BECAUSE, EVIDENCE = "Dónde", "Porque", "Qué lo muestra"
REACHES, PAGES, AGREEING = "Ecuaciones que alcanza", "páginas", "Elementos que coinciden"
EQUATION, ENTRY, ERRATUM = "Ecuación", "Elemento", "Errata"
RELATIVE_DIFFERENCE, EXPLAINED_BY, UNEXPLAINED = "Diferencia relativa", "Explicado por", "nada"
EFFECT_COLUMNS = ("cambio de ángulo hasta el horizonte (rad)", "corrida entera (rad)", "ganancia de energía")
PRINTED_STATUS = "Como se imprimió, ode45"
PRINTED_DEPARTS = "se aparta (rad, corrida entera)"
PRINTED_GAIN = "crea energía"
RAN_TO_THE_END = "llega al final"
NOT_HELD_NOTE = (
    "A las ecuaciones impresas no se les exige nada, ni frente a la referencia ni en su energía: que se aparten de "
    "ambas es el resultado. Que una corrida suya llegue al final no dice si es correcta."
)
DRIFT_COLUMN = "deriva de energía"
METRIC_COLUMNS = (
    "Error de ángulo hasta el horizonte (rad)", "Error de ángulo, corrida entera (rad)",
    "Error de punta hasta el horizonte (m)", "Deriva de energía (relativa)", "Holgura de juntas (m)", "Pala en cero",
    "Pasos", "Evaluaciones", "Preparación", "Corrida",
)  # fmt: skip
DIFFERENCE_COLUMNS = ("Hasta el horizonte (rad)", "Corrida entera (rad)", "Al final (rad)")
ENERGY_COLUMNS = ("Mayor energía cinética", "Trabajo al final", "Mayor ganancia", "Deriva (relativa)")
LARGEST_RATE = "mayor velocidad (rad/s)"
OFF_PLANE = "fuera del plano"
RANGE = "{} a {}"

_TITLES = {
    "paper/fig03": "Una pala desde el reposo, rotor a 165 grados",
    "paper/fig04b": "Una pala desde el reposo, rotor a 165 grados, masa sobre el eje de la pala",
    "paper/fig05": "Tres palas desde el reposo, rotor a 30 grados",
    "paper/fig06": "Tres palas, rotor a 30 grados y π/10 rad/s",
    "paper/fig06-tenth": "Tres palas, rotor a 30 grados y 1/10 rad/s (texto sobre la Fig. 6)",
    "paper/fig08": "Tres palas desde el reposo, pala 1 girada 45 grados",
    "paper/fig09": "Tres palas desde el reposo, giradas 45, 30 y 90 grados",
    "paper/fig11": "Tres palas giradas, rotor a 30 grados y π/10 rad/s",
    "paper/fig12": "Tres palas giradas, todas las coordenadas en movimiento",
    "paper/fig13b": "Tres palas giradas, todas las coordenadas en movimiento, pala 1 a π/8 rad/s",
    "paper/fig14a": "Rotor y pala 1 girados, tres velocidades de pala (par a de la Fig. 14; panel incierto)",
    "paper/fig14b": "Pala 3 girada, rotor y pala 1 en movimiento (par b de la Fig. 14; panel incierto)",
    "paper/fig14c": "Pala 1 girada 90 grados, rotor y pala 3 en movimiento (par c de la Fig. 14; panel incierto)",
    "paper/fig15-1kNm": "Tres palas desde el reposo, torque constante de 1 kN·m",
    "paper/fig15-10kNm": "Tres palas desde el reposo, torque constante de 10 kN·m (no está en el artículo)",
    "paper/fig15-50kNm": "Tres palas desde el reposo, torque constante de 50 kN·m (no está en el artículo)",
    "paper/fig15-100kNm": "Tres palas desde el reposo, torque constante de 100 kN·m",
}
_CONDITIONS = {
    "gravity": "9.8 m/s²; el artículo no imprime g. Con 9.81 la cresta de la Fig. 11 no es 2.73.",
    "duration": "10 s u 8 s; 10.83 s en la Fig. 5. El artículo no imprime cuánto dura una corrida. 10.83 s se halló "
    "haciendo coincidir los tres números de la Fig. 5, que salen todos de 10.829 a 10.836 s; la cresta de la Fig. 11 "
    "sale con 10 s. La duración fija también el paso más largo de ode45, un décimo de ella.",
    "integrator": "ode45 de MATLAB, RelTol 1e-6 y AbsTol 1e-9 (Tabla 1), lo demás por defecto; los extremos se leen en "
    "su salida refinada, cuatro puntos por paso.",
    "fig11": "La cresta es en parte error de integración: resueltas hasta converger, las mismas ecuaciones impresas la "
    "tienen en 2.746 rad. No es redondeo: inicios cambiados hasta en 4e-15 rad dan los mismos cinco dígitos.",
    "fig05": "El inicio de la Fig. 5 es un equilibrio de las ecuaciones correctas y de las impresas: en aritmética "
    "exacta nada se mueve. Lo que la figura muestra es error de redondeo, 1e-9 N m en la suma de los pesos de las tres "
    "palas respecto del eje, crecido desde un equilibrio inestable. 0.5273 sale de todo modo de sumar los pesos que "
    "deja un resto. Cuándo empieza el movimiento, y con ello 0.5127 y 0.0458 a una duración dada, depende del modo de "
    "sumar como de la duración: ambos se eligieron para que coincidan. Un inicio cambiado en 1e-15 rad da 0.5137 y "
    "0.0457, o ningún movimiento, como (56) en su forma impresa, simplificada.",
    "rounding": "En las Figs. 8, 14c y 15 un inicio cambiado en 1e-15 rad da a las ecuaciones impresas con ode45 otro "
    "curso antes de 10 s. Lo que se halla sobre una afirmación de estas figuras vale para un redondeo.",
}

_ERRATA = {
    ("E1", "entry"): "U32, fila 2, columna 4; y su derivada U32,3, fila 2, columna 4",
    ("E2", "entry"): "U33,3, fila 1, columna 4",
    ("E3", "entry"): "los últimos términos: la velocidad de pala a la primera potencia",
    ("E1", "printed"): "c c3; y -c s3",
    ("E1", "right"): "0; y 0",
    ("E1", "reason"): "el elemento es la derivada respecto de q2 de la fila 2, columna 4 de (3), c s3 + d2, que no "
    "contiene q2",
    ("E2", "reason"): "el elemento es la derivada respecto de q3 de la fila 1, columna 4 de (9), -c c2 s3",
    ("E3", "right"): "q̇3², q̇4², q̇5², como en (30); corregida E2, su coeficiente es cero",
    ("E3", "reason"): "el término ha de ser un torque, kg m²/s²; con la primera potencia de una velocidad es kg m²/s",
}


def scene_title(name: str, title: str) -> str:
    return _TITLES.get(name, title)


def condition(key: str, text: str) -> str:
    return _CONDITIONS.get(key, text)


def erratum(id_of: str, field: str, text: str) -> str:
    return _ERRATA.get((id_of, field), text)


def statement(text: str, quote: str) -> str:
    """The paper's own words: they are Spanish already."""
    return f"«{quote}»" if quote else text


def statement_note(quote: str) -> str:
    del quote  # it stands above
    return ""


def angle_column(side: str) -> str:
    return f"{side}: ángulo (rad)"


def length_column(side: str) -> str:
    return f"{side}: longitud de la trayectoria"


def viewer_described(title: str) -> str:
    return (
        f"{title}: las palas y las trayectorias de sus puntas en movimiento. Las imágenes de abajo lo muestran quieto."
    )


def coordinate(label: str) -> str:
    return label.replace("pitch", "pala")


def more_readings(count: int, failed: bool) -> str:
    return f"; {count} más {'así' if failed else 'se cumplen'}"


def not_so(relation_text: str) -> str:
    return f"no {relation_text}"


def figure_heading(number_of: str, kind: str) -> str:
    return f"{FIGURE} {number_of}: {FIGURE_TITLES[kind]}"


def walk_picture(figure: str, heading: str) -> str:
    return f"{FIGURE} {figure}, {heading}"


def conditions(angles: str, rates: str, torque: float | None, gravity: float, duration: float) -> str:
    parts = [f"q(0) = [{angles}] rad", f"dq/dt(0) = [{rates}] rad/s"]
    if torque is None:
        parts.append("un torque que cambia con el tiempo")
    elif torque:
        parts.append(f"torque en el rotor {prefixed(torque, 'N·m')}")
    return f"{', '.join(parts)}, g = {number(gravity, 3)} m/s², {quantity(duration, 's', 4)}."


def walk_same(facts: Facts) -> str:
    parts = []
    if facts.seen_apart is not None and facts.seen_apart > 0.0:
        how_long = "en toda la corrida" if facts.seen_apart == inf else f"hasta {quantity(facts.seen_apart, 's', 3)}"
        parts.append(f"el modelo impreso muestra el movimiento correcto {how_long}")
    if facts.exudyn is not None:
        parts.append(
            f"Exudyn y el modelo correcto difieren a lo más en {quantity(facts.exudyn, 'rad')} hasta "
            f"{quantity(facts.until, 's', 3)}"
        )
    return f"Igual: {'; '.join(parts)}." if parts else ""


def walk_different(facts: Facts) -> str:
    parts = []
    if facts.right_still and facts.printed_pitch is not None and facts.printed_pitch > 1e-3:
        parts.append(
            "en el modelo correcto ninguna pala gira sobre sí misma, en el impreso llegan a "
            f"{quantity(facts.printed_pitch, 'rad')}"
        )
    if facts.largest is not None and facts.seen_apart != inf:
        parts.append(f"los ángulos impresos se apartan de los correctos hasta en {quantity(facts.largest, 'rad')}")
    if facts.gain is not None and facts.gain > 1e3:
        parts.append(f"el modelo impreso crea {prefixed(facts.gain, 'J')} de la nada")
    if facts.ended is not None:
        parts.append(f"se desboca, y ode45 se rinde a {quantity(facts.ended, 's', 3)}")
    return f"Distinto: {'; '.join(parts)}." if parts else "Distinto: nada que se pueda ver."


def torques_same(exudyn: float | None) -> str:
    text = "Igual: todo torque pone en marcha el rotor desde el reposo"
    return (
        f"{text}."
        if exudyn is None
        else f"{text}; Exudyn y el modelo correcto difieren a lo más en {quantity(exudyn, 'rad')}."
    )


def torques_different(turned: Mapping[str, Mapping[str, float]]) -> str:
    parts = [
        f"{heading}: " + ", ".join(f"{number(value, 3)} rad con {torque}" for torque, value in by_torque.items())
        for heading, by_torque in turned.items()
    ]
    return (
        "Distinto: en el modelo correcto las palas siguen en cero y el rotor gira τt²/(2·3·m·(c²+d²)), tanto más "
        f"cuanto mayor el torque. Girado al final: {'; '.join(parts)}."
    )


def walk_number(what: str, unit: str, published: str, printed: str, right: str) -> str:
    name = f"{what[0].upper()}{what[1:]}"
    return f"{name}: publicado {published} {unit}; como se imprimió {printed}; modelo correcto {right}."


def scene_count(count: int) -> str:
    return f"{count} escena" if count == 1 else f"{count} escenas"


def energy_axis(prefix: str) -> str:
    return f"energía ({prefix}J)"


def status(name: str) -> str:
    return STATUSES.get(name, name)


def figures(text: str) -> str:
    if not text:
        return ""
    return f"{'Figuras' if ',' in text else 'Figura'} {text} del artículo"


def finding(facts: Finding) -> list[str]:
    sentences = [_reproduced(facts), _made_energy(facts.energy), _agreement(facts.agreement)]
    return [sentence for sentence in sentences if sentence]


def _reproduced(facts: Finding) -> str:
    if facts.numbers is None:
        return _claims_alone(facts)
    text = (
        f"{_share(facts.numbers)} números publicados se reproducen en cada dígito impreso al integrar las ecuaciones "
        f"tal como se imprimieron{_on_conditions(facts.reproduced)}"
    )
    if facts.numbers_right is not None:
        right = facts.numbers_right.count
        text += f". El modelo correcto {f'reproduce {right}' if right else 'no reproduce ninguno'}"
    if facts.claims_printed is not None and facts.claims_right is not None:
        text += (
            f"; de las afirmaciones del artículo el modelo impreso cumple {_share(facts.claims_printed)}, el correcto "
            f"{_share(facts.claims_right)}"
        )
    return text + "."


def _on_conditions(found: Sequence[Reproduced]) -> str:
    parts = []
    for one in found:
        what = f"{'el' if one.count == 1 else f'los {one.count}'} de la Fig. {one.figure}"
        parts.append(f"{what}, {GROWN_ROUNDING}, con {MATCHED}" if one.matched else f"{what} {_under(one)}")
    return f": {'; '.join(parts)}" if parts else ""


def _under(one: Reproduced) -> str:
    gravity = "" if one.gravity is None else f"g = {number(one.gravity)} m/s² y "
    return f"con {gravity}{quantity(one.duration, 's')}"


def _claims_alone(facts: Finding) -> str:
    parts = [
        f"{_share(tally)} se cumplen en el modelo {model}"
        for tally, model in ((facts.claims_printed, "impreso"), (facts.claims_right, "correcto"))
        if tally is not None
    ]
    return f"De las afirmaciones del artículo que este archivo decide, {' y '.join(parts)}." if parts else ""


def _made_energy(energy: PrintedEnergy | None) -> str:
    if energy is None:
        return ""
    start = "Tres faltas en las matrices impresas (E1, E2, E3) hacen inconsistente la energía del modelo impreso: "
    if not energy.made.count:
        return f"{start}aun así no crea energía digna de mención en {scene_count(energy.made.of)}."
    where = f"más de una milésima de la escala de energía en {energy.made.count} de {scene_count(energy.made.of)}"
    if energy.scene:
        most = f"entre las corridas que llegan al final hasta {prefixed(energy.gain, 'J')}"
        text = f"{start}crea energía de la nada, {where}, {most}"
    else:
        text = f"{start}crea energía de la nada, {where}"
    if energy.broke_off:
        text += f", y en {len(energy.broke_off)} se desboca hasta que ode45 se rinde"
    return text + "."


def _agreement(found: tuple[Agreement, ...]) -> str:
    known = [agreement for agreement in found if agreement.angle_error is not None]
    if not known:
        return ""
    models = len({model_of(agreement.method) for agreement in known})
    many = models > 1
    text = {1: "Un modelo correcto", 2: "Dos modelos correctos", 3: "Tres modelos correctos"}[models]
    if many:
        text += " que solo reciben los mismos datos de partida"
    errors = _listed(f"{quantity(a.angle_error, 'rad')} ({name_of(a.method)})" for a in known)
    text += (
        f" {'siguen' if many else 'sigue'} la referencia en precisión cuádruple dentro de {errors} hasta el horizonte "
        "de cada escena, donde un error ha crecido hasta 100 000 veces"
    )
    drifts = [a.energy_drift for a in known if a.energy_drift is not None]
    if drifts:
        text += f", y {'conservan' if many else 'conserva'} la energía a {number(max(drifts))} de su escala o mejor"
    failed = sum(a.runs.of - a.runs.count for a in found)
    if failed:
        text += f"; {failed} de {sum(a.runs.of for a in found)} de sus corridas no salieron bien y no se cuentan aquí"
    return text + "."


def _share(tally: Tally) -> str:
    return f"{tally.count} de {tally.of}"


def _listed(parts: Iterable[str]) -> str:
    items = list(parts)
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} y {items[-1]}"


def scene_lead(
    departure: float | None, horizon: float | None, gain: float | None, ended: float | None, right: float | None
) -> list[str]:
    found = []
    if ended is not None:
        found.append(f"El modelo impreso se desboca: ode45 se rinde a {quantity(ended, 's', 3)}.")
    elif departure is not None:
        text = f"El modelo impreso se aparta de la referencia hasta en {quantity(departure, 'rad')}"
        if gain is not None:
            text += f"; su energía crece hasta en {prefixed(gain, 'J')}"
        found.append(f"{text}.")
    if right is not None and horizon is not None:
        found.append(
            f"Hasta el horizonte, {quantity(horizon, 's', 3)}, los modelos correctos siguen la referencia dentro de "
            f"{quantity(right, 'rad')}."
        )
    return found


def ended_early(method: str, state: str, message: str, reached: float) -> str:
    text = f"{name_of(method)}: {status(state)}"
    if message:
        text += f". {message}"
    return f"{text} (muestras hasta {quantity(reached, 's', 4)})"


def motion_caption(name: str, marked: list[str]) -> str:
    if not marked:
        return name.capitalize()
    return f"{name.capitalize()}, en líneas; marcas: {'; '.join(marked)}"


def motion_described(name: str, ranges: list[tuple[str, float, float]]) -> str:
    parts = [f"{coordinate(label)} de {number(low, 3)} a {number(high, 3)} rad" for label, low, high in ranges]
    return f"{name} en el tiempo: {'; '.join(parts)}."


def cut_angles_note(largest: float) -> str:
    return f"Los ángulos fuera del eje se cortan; el mayor es {quantity(largest, 'rad')}."


def cut_rates_note(largest: float) -> str:
    return f"Las velocidades fuera del eje se cortan; la mayor es {quantity(largest, 'rad/s')}."


def cut_energy_note(largest: float) -> str:
    return f"Las energías fuera del eje se cortan; la mayor es {prefixed(largest, 'J')}."


def difference_described(errors: list[tuple[str, float]]) -> str:
    return "Mayor diferencia de ángulo con la referencia, eje logarítmico: " + "; ".join(
        f"{name} hasta {number(value)} rad" for name, value in errors
    )


def exact_note(names: list[str]) -> str:
    return f"Sin curva, por no pasar nunca de 10⁻¹⁸ rad: {'; '.join(names)}."


def exact_energy_note(names: list[str]) -> str:
    return f"Sin curva, por no pasar nunca de 10⁻¹⁸: {'; '.join(names)}."


def below_axis_note(uncertainty: float) -> str:
    if uncertainty == 0.0:
        return "Dos corridas de la referencia en precisión cuádruple no difieren en nada."
    return f"La referencia es segura hasta {quantity(uncertainty, 'rad')}, muy por debajo del eje."


def energies_described(name: str, start: float, end: float) -> str:
    return f"{name}: energía total menos trabajo {prefixed(start, 'J')} al inicio, {prefixed(end, 'J')} al final."


def energy_errors_described(errors: list[tuple[str, float]]) -> str:
    return "Error de energía, eje logarítmico: " + "; ".join(f"{name} hasta {number(value)}" for name, value in errors)


def paths_described(name: str, turned: float | None, off_plane: float) -> str:
    text = f"{name}: trayectorias de las puntas en el espacio con el diagrama de alambre al inicio y al final"
    if turned is not None:
        text += f"; el rotor termina a {number(turned, 3)} rad de su inicio"
    return f"{text}; las puntas dejan el plano de rotación hasta en {prefixed(off_plane, 'm')}."


def left_zero(time: float | None, rate: float | None) -> str:
    if time is None:
        return NEVER_LEFT
    text = f"dejado a {quantity(time, 's', 3)}"
    return text if rate is None else f"{text}, creciendo {quantity(rate, '/s', 3)}"


def zero_pitch_note(escape: float | None) -> str:
    text = (
        "Pala en cero: si los ángulos de pala que en la referencia son exactamente cero siguieron siéndolo; pasados "
        "10⁻⁹ rad lo han dejado."
    )
    if escape is not None:
        text += (
            " Una pala bajo el eje es un péndulo invertido: el redondeo crece hasta a √(g/c) = "
            f"{quantity(escape, '/s', 3)}."
        )
    return text


def quantity_name(quantity_asked: str, coordinate: int) -> str:
    body = "del rotor" if coordinate == 0 else f"de la pala {coordinate}"
    return f"{'ángulo' if quantity_asked == 'angle' else 'velocidad'} {body}"


STATISTIC_NAMES = {
    "min": "mínimo:",
    "max": "máximo:",
    "max_abs": "mayor magnitud:",
    "range": "amplitud:",
    "max_abs_change": "mayor cambio:",
    "net_change": "cambio de inicio a fin:",
    "reversals": "cambios de signo:",
    "growth": "crecimiento (salida tardía entre temprana):",
    "swing_ratio": "mayor entre menor oscilación:",
}
_UNITS = {"reversals": "", "growth": "", "swing_ratio": "", "angle": "rad", "rate": "rad/s"}


def asked(quantity_asked: str, coordinate: int, statistic: str) -> str:
    return f"{STATISTIC_NAMES.get(statistic, statistic)} {quantity_name(quantity_asked, coordinate)}"


def measured(value: float | None, quantity_asked: str, statistic: str) -> str:
    if value is None:
        return "indefinido (sin movimiento)"
    unit = _UNITS[statistic] if statistic in _UNITS else _UNITS[quantity_asked]
    return quantity(value, unit, 3) if unit else number(value, 3)


def relation(name: str, bound: float | None) -> str:
    words = {"<": "<", ">": ">", "opposite": "opuesto a"}[name]
    return words if bound is None else f"{words} {number(bound, 3)}"


def seconds(value: float) -> str:
    return quantity(value, "s", 3)


def agreeing_summary(count: int, largest: float) -> str:
    return f"{count} elementos coinciden con lo que se sigue de (3) a {number(largest)}"


def differing_caption(count: int, of: int) -> str:
    return f"{count} de {of} elementos impresos difieren de lo que se sigue de (3)"


def error_column(method: str) -> str:
    return f"{method[0].upper()}{method[1:]}: error de ángulo (rad)"


def effect_column(erratum: str, what: str) -> str:
    return f"{erratum}: {what}"


def rotor_caption(printed: str, right: str) -> str:
    return f"Solo el ángulo del rotor: {printed}, negro continuo; {right}, azul a trazos"
