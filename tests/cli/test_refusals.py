"""What commands refuse: exit status 2, one sentence with these words, and nothing written."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pytest
from commands import CONTACT_MODELS, Model, Run

import dmoc

# Below each beginning of commands: how one goes on, and words of its message.
COMMANDS = """
solve cart_pendulum
    --restitution 1.5 | expected a number from 0 (plastic) to 1 (elastic)
    --restitution lower=x | expected a number
    --restitution lef=0.5 | unknown surface, expected one of lower, upper
    --order 3 | order = 3: expected one of 2, 4
    --order 4 --controls linear | expected one of stages, constant with kernels of order 4
    --periodic beta | unknown state 'beta' in periodic
    --tolerance -1 | expected a positive number
    --set m_c=-1 | mass matrix is not positive definite at the start (m_c=-1)
    --set m_p=-1 | m_p=-1
    --set m_c=nan | parameter m_c = nan: expected a finite number
    --set m=1 | unknown parameter 'm'
    --set m_c | expected NAME=VALUE
    --start alpha=0.1 | the start (alpha=0.1) lies behind surface 'lower'
    --goal alpha=3 | the goal (alpha=3) lies behind surface 'upper'
    --start beta=0 | unknown state 'beta' at the start
    --goal x_dott=0 | did you mean 'x_dot'
    --bound F=10:-10 | the lower bound 10 exceeds the upper bound -10
    --bound F=60 | bounds of F = 60.0: expected a pair (lower, upper)
    --bound G=0:1 | unknown input, coordinate or velocity 'G'
    --bound F=a:1 | expected a number
    --start alpha_dot=1,p_alpha=1 | a fixed velocity (alpha_dot) and a fixed momentum (p_alpha)
    --seconds nan | expected a positive time limit
    --sequence up | unknown surface 'up' in the sequence: expected one of lower, upper
    --sequence lower,lowe | did you mean 'lower'
    --sequence lower,,upper | --sequence lower,,upper: a word is missing beside a comma
    --sequence ,lower | --sequence ,lower: a word is missing beside a comma
    --sequence lower,, | --sequence lower,,: a word is missing beside a comma
    --sequence , | --sequence ,: a word is missing beside a comma
    --sequence ,, | --sequence ,,: a word is missing beside a comma
    --sequence lower --via x=1,x=2 | --via x is given twice
    --sequence lower --durations 0,0 | durations of phase 0 = 0: expected a positive time
    --sequence lower --durations free,none | --durations = 'none': expected a number such as 0.5
    --steps 0 | expected a whole number of at least 2 steps
    --steps -5 | expected a whole number of at least 2 steps
    --steps 10,10,10 | one for each of the 2 phases
    --steps 1000000000 | expected at most 100000 steps
    --steps 50000 --method slsqp | takes at most 2000 inputs in all steps
    --steps many | expected a whole number
    --final-time -1 | expected a positive time
    --final-time 2:1 | exceeds the upper bound
    --method newton | expected one of slsqp, ipm, ipopt, uno
    --out /proc/nowhere | cannot be written
    --json /proc/nowhere/x.json | cannot be written
solve contacts.py:landing --start x=0,y=0 --goal x=1,x_dot=0 --final-time 4 --steps 8 --starts 1
    --contacts flor | unknown contact 'flor' in contacts: expected one of floor, side
    --contacts floor:slide | expected a contact with friction and stick, slip+ or
    --sequence -floor | floor leaves, but is not closed then
    --sequence '+floor +floor' | names 'floor' twice: say it once
    --ignored top | unknown surface 'top' in ignored
    --periodic x=z | unknown state 'z' in periodic
    --via x=1 | via has 1 entries: expected one for each of the 0 events
sweep cart_pendulum --steps 12 --set
    l=0.5 | no value is a range: give one as FROM:TO:COUNT
    l=0.4:0.6:x | COUNT of --set l = 'x': expected a whole number
    l=0.4:inf:3 | with 1 to 10000 finite values
    l=0.4:a:3 | --set l = 'a': expected a range FROM:TO:COUNT
    k=0.4:0.6:3 | unknown parameter 'k'
    l=0.4:0.6:3 --out t.txt | expected a file that ends in .csv or .npz
    l=0.4:0.6:3 --workers 0 | workers = 0
    l=0.4:0.6:3 --plot no/f.png | no/f.png cannot be written
search puck_table
    --max-collisions 1 --strategy beam --beam 0 | beam = 0
generate cart_pendulum
    --page page.htm | page.htm is no page: end it in .html
    --page page.html --solver | --page writes one file: give it without --solver and --out
    --page /proc/nowhere/page.html | cannot be written
animate
    nothing.npz | nothing.npz does not exist
    one.npz -o film.avi | end it in .html, .gif or .mp4
    one.npz -o film.gif --fps 1000 | fps = 1000
    one.npz -o film.gif --speed -1 | speed = -1.0
new
    my-system | is not a C identifier
    2d | is not a C identifier
    ../x | is not a C identifier
    lambda | is a keyword
    random | is that of a module
    sympy | is that of a module
    dmoc | is that of a module
    begun --out /proc/nowhere | cannot be written
simulate cart_pendulum --final-time 1
    --start=x=1 --start x=2 | --start x is given twice
    --input=F=1 --input F=2 | --input F is given twice
    --set=l=1 --set l=2 | --set l is given twice
simulate bouncing_pendulum
    --final-time 1 --restitution 0.5,wall=0.6 | --restitution 0.5 stands beside others
    --model cart_pendulum | --model goes with a solution file
    --steps 5 | --final-time is missing
    --final-time -1 | --final-time -1: expected a positive
    --final-time nan | --final-time nan: expected a positive
    --final-time 1 --start p=1 | expected one of theta
    --final-time 1 --start theta=0:1 | expected a number
    --final-time 1 --steps 0 | steps = 0
simulate
    one.npz --final-time 1 | goes with a model
fit cart_pendulum nothing.csv
    --sigma x=0.1 | --parameter is missing: say what is fitted
    --parameter m_p=1:2 | nothing.csv cannot be read
    --parameter m_p | expected NAME=VALUE
    --parameter m_p=1:2 --sigma x | --sigma x: expected NAME=VALUE or NAME=COLUMN
export
    one.npz -o x.xlsx | .csv or .json
"""
# Lines of a model file that make the system or problem `s`, and words of the message.
MODELS = r"""
    s = make(lagrangian=m*g*y + m*sp.cos(y)) | does not contain the velocity of coordinate y
    s = make(coordinates=[y, x], lagrangian=m*(y.diff(t)+x.diff(t))**2/2 - m*g*y) | is singular
    s = make(coordinates=[y, x]) | does not contain the velocity of coordinate x
    s = make(lagrangian=m*y.diff(t)**2/2 - m*g*y*k) | contains the symbol k, which is unknown
    s = make(parameters={m: 1.0, g: 9.81, k: 1.0}) | parameter k is used nowhere
    s = make(parameters={m: 1.0}) | contains the symbol g, which is unknown
    s = make(parameters={m: None, g: 9.81}) | parameter m of model 'mass' has no value
    s = make(parameters={m: math.nan, g: 9.81}) | parameter m = nan: a finite number was expected
    s = make(parameters={m: -1.0, g: 9.81}) | matrix is not positive definite at the start (m=-1)
    s = make(inputs=[u, dynamicsymbols('w')]) | input w appears in no force
    s = make(name='int') | is a keyword of C or Python
    s = make(name='../../x') | is not a C identifier
    s = make(name='x;system("rm")') | is not a C identifier
    s = make(surfaces={'a b': y >= 0}) | is not a C identifier
    s = make(parameters={m: 1.0, g: 9.81, sp.Symbol('*/ int main(){'): 1.0}) | is not a C identifier
    s = make(forces={y: u + sp.gamma(y)}) | cannot be turned into C
    s = make(surfaces={'floor': y}) | is not an inequality
    s = make(coordinates=[y, d], lagrangian=both) | coordinate 'durations' has the name of the times
    s = make(parameters={m: 1.0, g: 9.81, t: 1.0}) | the parameter 't' has the name of the time
    s = make(lagrangian=m*y.diff(t)**4/2 - m*g*y) | not quadratic in the velocities
    s = make(lagrangian=m*y.diff(t, 2)**2/2 - m*g*y) | not the first derivative of a coordinate
    s = 3 | expected a MechanicalSystem or a Problem
    r = make() | defines no 's'
    s = make( | cannot be read
    s = 1 / 0 | cannot be loaded: ZeroDivisionError in line
    import sys; sys.exit(0) | ends the program: a model file must not call sys.exit
    def s(): raise SystemExit | ends the program
    def s(): return 1 / 0 | cannot be loaded: ZeroDivisionError in line
    def s(): raise ValueError('[red]two\nlines[/x]') | [red]two lines[/x]; correct the file
    Own = type('Own', (BaseException,), {}); raise Own | cannot be loaded: Own in line
    def s(name, more=1): return make() | s in {folder}/system.py needs the arguments name
    def s(): return s() | cannot be loaded: RecursionError in line
    def s(): return None | is None: expected a MechanicalSystem or a Problem
    import sys; sys.path = []; del sys.path[:]; raise KeyError | cannot be loaded: KeyError in line
    import sys; sys.path.clear(); s = 3 | is 3: expected a MechanicalSystem or a Problem
"""


def rows(text: str) -> list[tuple[str, str]]:
    """Commands or lines and their messages; what begins a line further left goes before."""
    before, pairs = "", []
    for line in text.strip("\n").splitlines():
        first, _, message = line.rpartition(" | ")
        if message == line and not line.startswith(" "):
            before = line
        else:
            pairs.append((f"{before} {first.strip()}".strip(), message))
    return pairs


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, solution: dmoc.Solution) -> dict[str, bytes]:
    path = solution.save(tmp_path_factory.mktemp("files") / "one.npz")
    return {"one.npz": path.read_bytes(), "contacts.py": CONTACT_MODELS.encode()}


@pytest.mark.parametrize(("command", "message"), rows(COMMANDS))
def test_wrong_options_are_one_sentence_and_write_nothing(
    run: Run, files: dict[str, bytes], tmp_path: Path, command: str, message: str
) -> None:
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    code, out, err = run("", *shlex.split(command))
    assert code == 2 and message in err.replace("\n", " ")
    assert err.startswith("error: ") and err.count("\n") == 1 and not out
    assert {p.name for p in tmp_path.iterdir()} - {"__pycache__"} == set(files)


@pytest.mark.parametrize(("line", "message"), rows(MODELS))
def test_bad_models_are_one_sentence(
    run: Run, file: Model, tmp_path: Path, line: str, message: str
) -> None:
    paths, places = sys.path, list(sys.path)
    start = "y=1,x=0" if "[y, x]" in line else "y=1"
    code, out, err = run(f"solve {file(line)} --start {start} --final-time 1")
    assert code == 2 and message.format(folder=tmp_path) in err.replace("\n", " ")
    assert err.count("\n") == 1 and "Traceback" not in err and not out
    assert sys.path is paths and sys.path == places
    code, _, err = run(f"derive {file(line)}")
    assert code in (0, 2) and err.count("\n") == (code == 2)


@pytest.mark.parametrize("command", ["derive", "generate", "build", "solve"])
@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("pendulum_cart", "unknown model 'pendulum_cart'"),
        ("a.npz", "'a.npz' names a file of a result: expected a model; read a solution with"),
        ("nothing.py:s", "does not exist"),
        ("a.txt:s", "does not exist"),
    ],
)
def test_unknown_models_are_named(run: Run, command: str, reference: str, message: str) -> None:
    code, _, err = run(f"{command} {reference}")
    assert code == 2 and message in err
