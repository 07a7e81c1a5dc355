"""What docs/clusters.md and the scripts beside it say."""

import re
import shlex
import subprocess

import yaml

from bench.run.shards import ARRAYS, shard_of
from tests.places import ROOT

DOCS = ROOT / "docs"
PAGE = (DOCS / "clusters.md").read_text(encoding="utf-8")
SLURM = (DOCS / "sweep.slurm").read_text(encoding="utf-8")
JOB = yaml.safe_load((DOCS / "sweep-job.yaml").read_text(encoding="utf-8"))


def sweep_of(text):
    """The words of the sweep in a script."""
    found = re.search(r"python -m bench\.sweep[^\n]*", text.replace("\\\n", " "))
    return shlex.split(found.group())


def after(words, option):
    return words[words.index(option) + 1]


def test_the_slurm_script_is_whole_and_every_element_does_its_part(tmp_path):
    subprocess.run(["bash", "-n", str(DOCS / "sweep.slurm")], check=True)
    options = dict(re.findall(r"^#SBATCH --([a-z-]+)=(.*)$", SLURM, re.M))
    first, last = map(int, options["array"].split("-"))
    fake = tmp_path / "srun"
    fake.write_text('#!/bin/sh\necho "$@"\n')
    fake.chmod(0o755)
    done = subprocess.run(
        ["bash", str(DOCS / "sweep.slurm")],
        env={"PATH": f"{tmp_path}:/usr/bin:/bin", "SLURM_CPUS_PER_TASK": options["cpus-per-task"]},
        capture_output=True,
        text=True,
        check=True,
    )
    words = sweep_of(done.stdout)
    assert after(words, "--jobs") == options["cpus-per-task"]
    count = last - first + 1
    array = {"SLURM_ARRAY_TASK_MIN": f"{first}", "SLURM_ARRAY_TASK_COUNT": f"{count}"}
    indices = [
        shard_of(after(words, "--shard"), array | {"SLURM_ARRAY_TASK_ID": f"{i}"}).index
        for i in range(first, last + 1)
    ]
    assert indices == list(range(1, count + 1))


def test_the_pods_of_the_job_do_all_parts():
    spec, (container,) = JOB["spec"], JOB["spec"]["template"]["spec"]["containers"]
    assert (JOB["apiVersion"], JOB["kind"]) == ("batch/v1", "Job")
    assert spec["completionMode"] == "Indexed"
    words = sweep_of(container["command"][-1])
    shards = [
        shard_of(after(words, "--shard"), {"JOB_COMPLETION_INDEX": f"{i}"})
        for i in range(spec["completions"])
    ]
    assert {s.index for s in shards} == set(range(1, spec["completions"] + 1))
    assert {s.count for s in shards} == {spec["completions"]}
    assert after(words, "--jobs") == container["resources"]["requests"]["cpu"]
    volumes = {v["name"] for v in spec["template"]["spec"]["volumes"]}
    assert {m["name"] for m in container["volumeMounts"]} == volumes


def test_the_page_names_what_shards_are_taken_from():
    names = [name for array in ARRAYS.values() for name in vars(array).values() if name]
    assert [name for name in names if f"`{name}`" not in PAGE] == []
    links = re.findall(r"\]\(([^)]+)\)", PAGE)
    assert links
    assert [link for link in links if not (DOCS / link).is_file()] == []
