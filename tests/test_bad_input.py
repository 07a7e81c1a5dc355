"""What a user types wrong: one sentence, exit code 2, and no file is made, whatever the command."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from slams.__main__ import main
from slams.formats.occupancy import write_map
from slams.formats.trajectory import write_tum
from slams.state import save
from slams.types import OccupancyGrid
from tests.floors import grid_of
from tests.rooms import drive, rewritten, settled
from tests.slams.live.commands import environment

# a command, what is wrong with it, and a part of the sentence
LINES = """
run hector | no log given
run hector none.npz | none.npz: no such file
run hector cut.npz | damaged, cut short
run hector keys.npz | keys: got no ranges
run hector nan.npz | stamps that are not finite
run hector . | is a directory
run hectr room.npz | unknown algorithm 'hectr'; did you mean 'hector'
run hector@old room.npz | hector has no preset 'old'; expected one of default
run hector room.npz --set level=2 | unknown parameter 'level'; did you mean 'levels'
run hector room.npz --set levels | expected KEY=VALUE
run hector room.npz --set levels=0 | expected 1 to 6
run hector room.npz --params text.yaml | unknown parameter 'nothing'
run hector room.npz --params none.yaml | none.yaml: no such file
run hector room.npz --limit 0 | --limit: got 0
run hector room.npz --lim 3 | unrecognized arguments: --lim
run hector room.npz --no-odometry --odom none | --no-odometry: got --odom or --imu, too
run hector room.npz --seed -1 | parameter 'seed': got -1
run hector room.npz --sensor lsd01 | 'lsd01'; did you mean 'lds01'
run hector room.npz --ros-params none.yaml | none.yaml: no such file or directory
run kiss room.npz --ros-params text.yaml | Kiss has no original in ROS
run tsd room.npz --ros-params text.yaml | text.yaml: no parameter of
run tsd room.npz --resume-state hector.state | the state of hector, expected one of tsd
run hector room.npz --resume-state hector.state --set levels=2 | saved with levels 3, got 2
run hector room.npz --resume-state room.npz | not a state: no head;
run hector room.npz --resume-state . | is a directory
run hector room.npz --save-state . | is a folder
run kiss room.npz --save-state k | kiss cannot be saved: slam._icp_class is of the class
run hector room.npz --localize bad.yaml | its picture none.pgm is not
run hector room.npz --localize room.npz | not a state
run odometry room.npz --localize map.yaml | odometry cannot localize in a map that is given
run hector room.npz --localize map.yaml --start=1,2,nan | --start
run hector room.npz --localize map.yaml --start= | --start
convert room.npz | OUT.npz
info none.log | no such file
info text.yaml | not an npz file
check | required: algorithm
check hecter | did you mean 'hector'
check slams.baselines:None_ | algorithm 'slams.baselines:None_'
compare none.npz | none.npz: no such file
run hector room.npz --save-state '' | --save-state: got an empty value
run hector room.npz --save-state= | --save-state: got an empty value
run hector room.npz --save-state ./room.npz --force | room.npz, the log itself
run hector room.npz ./room.npz | a file twice
run hector@paper room.npz --resume-state hector.state | saved with estimator filter, got plain
run hector room.npz --localize hector.state --set resolution=0.1 | saved with resolution 0.05
run hector room.npz --localize map.yaml --start=100,100,0 | no beam of the first scan ends
run hector room.npz --localize full/map.yaml | full/map.yaml: a map of 24 occupied and 0 free cells
compare --algorithms nobody | unknown algorithm 'nobody'
compare --jobs 0 | --jobs: got 0
compare --relations r.txt | expected the one they are of
compare --truth t.tum | --truth: got no log
compare room.npz --duration 3 | --duration: only for a simulated log
compare --sensor lsd01 | unknown sensor 'lsd01'; did you mean 'lds01'
compare --ros-params slam.launch | got 'slam.launch', expected ALGORITHM=FILE
compare --ros-params tsd= | got 'tsd=', expected ALGORITHM=FILE
compare --ros-params hector@original=f | got 'hector@original', expected one that is
compare --ros-params hector=none.yaml | none.yaml: no such file
compare --ros-params kiss=none.yaml | Kiss has no original in ROS
compare --seed -1 | parameter 'seed': got -1
compare --algorithms hector:resolutoin=0.1 | did you mean 'resolution'
compare --algorithms tsd --seed x | parameter 'seed': got 'x', expected int
compare --algorithms tsd --seed tsd:x | parameter 'seed'
compare --algorithms tsd --seed hector:1 | of one that is compared: tsd
compare --algorithms tsd --set cel=1 | got 'cel=1', expected a parameter of tsd; did you mean 'cell'
compare --algorithms tsd --set tsd:cell=-1 | parameter 'cell': got -1
compare --algorithms tsd --params tsd: | got 'tsd:', expected ALGORITHM:FILE
compare room.npz --trajectory x | expected NAME=WHAT
compare room.npz --map x | expected NAME=FILE
compare room.npz --trajectory x=none.tum | none.tum
compare room.npz --trajectory kiss=good.tum | the name of an existing row
compare room.npz --trajectory x=good.tum --trajectory x=good.tum | twice
compare room.npz --map x=good.tum | expected a name given to --trajectory
compare room.npz --trajectory x=one.tum | x
compare room.npz --trajectory x=away.tum | is it another log's?
compare room.npz --trajectory x=good.tum --map x=good.tum | good.tum
compare room.npz --starts 3 | --relations
compare room.npz --starts 0 | --starts: got 0
sweep --degradations nois=0.05 | did you mean 'noise'
sweep --degradations qqq | 'qqq' (known: clean, rate,
sweep --degradations noise=-1 | noise
sweep --arenas moon | unknown arena 'moon'
sweep --algorithms hectar | did you mean 'hector'
sweep --algorithms hectar:refine=1 | did you mean 'hector'
sweep --algorithms hector:refin=no | did you mean 'refine'
sweep --algorithms hector:refine=no, | expected NAME:KEY=VALUE[,KEY=VALUE]
sweep --algorithms hector:refine=1,refine=0 | each KEY once
sweep --algorithms hector --set hector:refin=false | did you mean 'refine'
sweep --algorithms hector --set hector:refine=maybe | 'refine': got 'maybe', expected bool
sweep --algorithms hector --set hector:refine | --set: got 'refine', expected KEY=VALUE
sweep --algorithms hector --set refine | got 'refine', expected ALGORITHM:KEY=VALUE
sweep --algorithms hector --set tsd:refine=no | expected ALGORITHM:KEY=VALUE of one that is
sweep --algorithms hector --params hector:none.yaml | none.yaml
sweep --seeds 0 | --seeds: got 0, expected 1 to 1000
sweep --seed -1 | --seed: got -1, expected 0
sweep --jobs 0 | --jobs: got 0, expected 1 or more
sweep --sensor lds3 | unknown sensor
sweep --duration 1 | --duration: got 1
sweep --duration long | --duration: invalid float value: 'long'
sweep none.npz | none.npz
sweep --out . | .: has files that are not of a sweep
sweep blind.npz | has no ground truth; a sweep needs one
sweep --scan-topic /scan | --scan-topic: got no log
sweep none.npz --arenas ring | --arenas: only for simulated drives; got none.npz
sweep none.npz --duration 9 | --duration: only for simulated drives
ablation | required: ALGORITHM
ablation hectar | did you mean 'hector'
ablation odometry | odometry: has no switch
ablation hector --arenas moon | unknown arena 'moon'
ablation hector --duration 1 | --duration: got 1
localize --arenas 0 | --arenas: got 0, expected 1 or more
localize --duration 0.5 | --duration: got 0.5, expected 2 to
localize --algorithms odometry | odometry cannot localize in a map that is given
localize --algorithms | --algorithms: expected at least one argument
loops --buildings 0 | --buildings: got 0, expected 1 or more
loops --algorithms gmapping:n_particles=0 | n_particles
loops --algorithms nobody | nobody
simulate s.npz --size 8 --arena none.yaml | none.yaml
simulate s.npz --size 8 --arena rescu | no such file; expected
simulate s.npz --size 8 --arena none.png --resolution 0.05 | none.png
simulate s.npz --size 10 --arena ring | expected 12 to 300 for the ring arena
simulate s.npz --size 8 --sensor utm30 | did you mean 'utm30lx'
simulate s.npz --size 8 --duration -1 | expected 0.1 to
simulate s.npz --size 8 --noise nan | noise
simulate s.npz --size 8 --dropout 1.5 | expected 0 to 1
simulate s.npz --size 8 --clearance 3 | no room to drive
simulate s.npz --size 8 --picture arena.doc | ends in .png
simulate s.txt --size 8 | ends in .npz
simulate room.npz --size 8 | room.npz: exists; --force replaces it
simulate s.npz --size 8 --picture map.pgm | ends in .png
simulate nowhere/s.npz --size 8 | no such folder
live hectro | did you mean 'hector'
live odometry --domain-id 233 | domain: got 233, expected 0 to 232
live odometry --map-every -1 | --map-every: got -1, expected 0 to 3600 s
live odometry --tf-ahead 1e10 | --tf-ahead: got 1e+10, expected 0 to 3600 s
live odometry --record a.bag | expected a name that ends in .mcap
live odometry --record full/room.mcap | full/room.mcap: exists; --force replaces it
live odometry --save-state hector.state | hector.state: exists
live odometry --out . | .: exists
live hector --map m --map-every 9 | --map-every: got --localize
play nothing.npz | nothing.npz: no such file
play room.npz --no-odometry --odom none | --no-odometry: got --odom
play room.npz --rate 1e-300 | --rate: got 1e-300, expected 0.01 or more
play room.npz --wait-for-subscriber nan | got nan, expected 0 s or more
play room.npz --remap scan | --remap: got 'scan', expected /FROM:=/TO
play room.npz --remap /a:=/b | --remap: no topic /a
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a good log, and files that something is wrong with."""
    folder = tmp_path_factory.mktemp("folder")
    log = drive(n=60)
    log.save(folder / "room.npz")
    rewritten(folder / "room.npz", folder / "nan.npz", t=np.full(60, np.nan))
    rewritten(folder / "room.npz", folder / "blind.npz", truth=None, truth_t=None)
    np.savez(folder / "keys.npz", t=np.zeros(3))
    (folder / "cut.npz").write_bytes((folder / "room.npz").read_bytes()[:5000])
    (folder / "text.yaml").write_text("nothing: 1\n")
    for name, rows, later in (("good", 60, 0.0), ("one", 1, 0.0), ("away", 60, 1e6)):
        write_tum(folder / f"{name}.tum", log.t[:rows] + later, log.truth_at(log.t)[:rows])
    save(settled("hector", 3), folder / "hector.state")
    write_map(folder, grid_of())
    (folder / "full").mkdir()
    (folder / "full/room.mcap").write_bytes(b"mine")
    write_map(folder / "full", OccupancyGrid(np.ones((4, 6), np.float32), 0.05, (0.0, 0.0)))
    (folder / "bad.yaml").write_text("image: none.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
    return folder


@pytest.mark.parametrize("line", LINES.strip().splitlines())
def test_it_is_one_sentence_and_exit_2(line, folder, monkeypatch, capsys):
    words, sentence = line.split(" | ")
    if words.startswith(("live", "play")):
        pytest.importorskip("cyclonedds", reason="needs the extra live")
    for name, value in environment().items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(folder)
    before = sorted(Path().rglob("*"))
    assert main(shlex.split(words)) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(f"slams {words.split()[0]}: ") and said.err.count("\n") == 1
    assert sentence in said.err
    assert sorted(Path().rglob("*")) == before
