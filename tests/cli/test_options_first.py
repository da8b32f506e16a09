"""A mistyped option is told at once: before the source is looked for, which may have to be rendered or read whole."""

import pytest

from tests.cli.test_cli import fails, in_process

NOWHERE = "cold:nowhere"
SLIPS = [
    # what is asked for                                                 what the one line must say
    (["replay", NOWHERE, "--set", "omgea=2"],                           "omgea"),
    (["replay", NOWHERE, "--set", "omega=1,85"],                        "a number with a decimal point, got '1,85'"),
    (["replay", NOWHERE, "--set", "n_new=2.5"],                         "n_new: expected a whole number, got '2.5'"),
    (["replay", NOWHERE, "--omega", "1.85"],                            "a parameter; set it with: --set omega=1.85"),
    (["replay", NOWHERE, "--merge-y=2"],                                "--set merge_y=2"),
    (["ablate", NOWHERE, "--bins", "--json"],                           "--set hog.bins=VALUE"),
    (["view", "--omega", "2"],                                          "No such option: --omega"),
    (["replay", NOWHERE, "--config", "none.toml"],                      "none.toml"),
    (["replay", NOWHERE, "--preset", "paper"],                          "unknown preset"),
    (["replay", NOWHERE, "--descriptor", "hogg"],                       "did you mean hog?"),
    (["replay", NOWHERE, "--limit", "0"],                               "--limit"),
    (["replay", NOWHERE, "--every", "0"],                               "--every"),
    (["replay", NOWHERE, "--no-rrd", "--spawn"],                        "--no-rrd"),
    (["describe", NOWHERE, "--out", "d.npz", "--set", "omgea=2"],       "omgea"),
    (["describe", NOWHERE, "--out", "none/d.npz"],                      "there is no folder none"),
    (["describe", NOWHERE, "--out", "taken"],                           "taken exists"),
    (["map", "none.npz", "--set", "omgea=2"],                           "omgea"),
    (["baseline", NOWHERE, "--k", "0"],                                 "must be 1 or more, got 0"),
    (["baseline", NOWHERE, "--k", "two"],                               "--k 'two'"),
    (["baseline", NOWHERE, "--method", "spectal"],                      "did you mean spectral?"),
    (["baseline", NOWHERE, "--similarity", "gaussian"],                 "did you mean gaussian-median?"),
    (["baseline", NOWHERE, "--method", "kmeans", "--similarity", "knn"], "uses no similarity"),
    (["baseline", NOWHERE, "--method", "rooms", "--k", "3"],            "takes no number of clusters"),
    (["baseline", NOWHERE, "--at-k-of", "none"],                        "none is not a run folder"),
    (["baseline", NOWHERE, "--set", "omgea=2"],                         "omgea"),
    (["ablate", NOWHERE, "--vary", "omgea=2"],                          "omgea"),
    (["ablate", NOWHERE, "--vary", "omega=x"],                          "omega"),
    (["ablate", NOWHERE, "--axes", "none.toml"],                        "none.toml"),
    (["ablate", NOWHERE, "--exact", "omega"],                           "--exact"),
    (["ablate", NOWHERE, "--set", "omgea=2"],                           "omgea"),
    (["ablate", NOWHERE, "--jobs", "0"],                                "--jobs"),
    (["ablate", NOWHERE, "--rrd", "worst"],                             "the only choice is best"),
    (["ablate", NOWHERE, "--resume"],                                   "--resume"),
    (["check", NOWHERE, "--reference", "none.toml", "--set", "omgea=2"], "omgea"),
    (["check", NOWHERE, "--reference", "none.toml", "--junit", "none/x.xml"], "there is no folder none"),
    (["check", NOWHERE, "--reference", "none.toml", "--junit", "x.xml", "--update"], "--junit"),
    (["report", "none", "--format", "pdf"],                             "--format"),
    (["report", "none", "--format", "md", "--out", "x"],                "leave --out out"),
    (["compare", "none", "--format", "pdf"],                            "--format"),
    (["explain", "none"],                                               "--refused"),
    (["explain", "none", "--refused", "--within", "-1"],                "--within"),
    (["diff", "none", "none", "--rrd", "taken"],                        "taken exists"),
    (["render", "none", "--every", "0"],                                "--every"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "words"), SLIPS, ids=[" ".join(row[0]) for row in SLIPS])
def test_a_slip_is_told_before_the_source_is_looked_for(arguments, words, tmp_path):
    (tmp_path / "taken").write_text("mine")
    fails(in_process(*arguments, cwd=tmp_path), 2, words)
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]
