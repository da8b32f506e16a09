"""What a run replayed is opened again as it was, or refused with a sentence."""

import re
import shutil

import numpy as np
import pytest

import omnieval
from omnieval.archiving import describe_archive
from omnieval.config import resolve
from omnieval.datasets import load
from omnieval.errors import ConfigError, DatasetError, ResultError
from omnieval.loop import replay
from omnieval.material.opening import opened
from omnieval.material.reopened import reopened
from omnieval.material.source import Cut
from omnieval.results.provenance import dataset_fingerprint

TINY = """
import numpy as np
import omnieval

class Tiny:
    def describe(self, panorama):
        rows = np.array_split(panorama.astype(np.float32), 8)
        turn = np.array_split(panorama.astype(np.float32), 16, axis=1)
        return omnieval.Description(
            np.array([row.mean() for row in rows], np.float32),
            np.array([[cell.mean(), cell.std()] for cell in turn], np.float32),
        )
"""


@pytest.fixture
def images(panoramas, tmp_path):
    """The three places in a folder that can be spoiled."""
    return shutil.copytree(panoramas, tmp_path / "images")


@pytest.fixture
def own(tmp_path):
    """The file of a descriptor of your own."""
    file = tmp_path / "own.py"
    file.write_text(TINY)
    return file


def mapped(source, out, **options):
    """A run of the fastest mapper."""
    return replay(source, mapper="leader", out=out, **options)


def what_is_opened(run):
    """The material of a run, its fingerprint, and its position descriptors, shape (n, d)."""
    with reopened(run) as material:
        described = list(material.described)
    print_ = dataset_fingerprint(material.frames, [one.digest for one in described])
    return material, print_, np.stack([one.description.position for one in described])


def described_until_refused(run, words):
    """How many descriptions a run's material gives before it is found to be another."""
    given: list[object] = []
    with reopened(run) as material, pytest.raises(ResultError, match=words):
        given.extend(material.described)
    return len(given)


def test_a_run_is_opened_as_it_was(images, tmp_path):
    cut = Cut(3, 2, 30)
    run = mapped(images, tmp_path / "run", start=3, stride=2, limit=30)
    material, print_, positions = what_is_opened(run)
    with opened(images, resolve(), cut) as fresh:
        assert (material.frames, material.cut, material.camera) == (fresh.frames, cut, fresh.camera)
        assert np.array_equal(positions, np.stack([one.description.position for one in fresh.described]))
    assert print_ == run.manifest["dataset_fingerprint"]
    assert material.about == {name: run.manifest[name] for name in material.about}


def test_an_archive_is_opened_as_it_was_with_its_cut(images, tmp_path):
    file = tmp_path / "three.npz"
    describe_archive(images, file)
    run = mapped(f"npz:{file}", tmp_path / "run", start=5, stride=3, limit=20)
    material, print_, _ = what_is_opened(run)
    assert [frame.file for frame in material.frames] == [f"image{number}.png" for number in range(5, 65, 3)]
    assert print_ == run.manifest["dataset_fingerprint"]
    assert material.descriptor.name == run.config.descriptor.name == "archive"
    with opened(str(file), run.config) as again:
        assert len(again.frames) == 80
    with pytest.raises(ConfigError, match="leave the descriptor out"):
        mapped(str(file), tmp_path / "gist", descriptor="gist")


def test_an_archive_that_was_written_again_is_refused(images, tmp_path):
    file = tmp_path / "three.npz"
    describe_archive(images, file)
    run = mapped(file, tmp_path / "run")
    (images / "image70.png").write_bytes((images / "image0.png").read_bytes())
    describe_archive(images, file, overwrite=True)
    assert described_until_refused(run, "are not those that .*run replayed; replay it again") == 79


@pytest.mark.parametrize("file", ["image0.png", "image79.png"])
def test_an_image_that_was_replaced_is_noticed_at_the_end(images, tmp_path, file):
    run = mapped(images, tmp_path / "run")
    (images / file).write_bytes((images / "image20.png").read_bytes())
    assert described_until_refused(run, "are not those that .*run replayed; replay it again") == 79


def test_a_pose_that_was_corrected_is_noticed(images, tmp_path):
    run = mapped(images, tmp_path / "run")
    table = images / "poses.csv"
    table.write_text(re.sub(r"(?m)^image9\.png,[^,]+", "image9.png,1.5", table.read_text()))
    assert described_until_refused(run, "images, poses or labels") == 79


def rename(images):
    (images / "image30.png").rename(images / "image30b.png")
    table = images / "poses.csv"
    table.write_text(table.read_text().replace("image30.png", "image30b.png"))


def drop_the_last(images):
    (images / "image79.png").unlink()
    table = images / "poses.csv"
    table.write_text("\n".join(table.read_text().splitlines()[:-1]) + "\n")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (rename, r"step 30 of .*run is of image30\.png, .* has image30b\.png there; replay it again"),
        (drop_the_last, r"step 79 of .*run is of image79\.png, .* has nothing there"),
    ],
)
def test_other_names_are_refused_at_once(images, tmp_path, spoil, words):
    run = mapped(images, tmp_path / "run")
    spoil(images)
    with pytest.raises(ResultError, match=words), reopened(run):
        pass


def test_a_run_that_was_interrupted_is_held_against_the_images_it_came_to(images, tmp_path):
    def interrupt(done, total):
        if done == 40:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mapped(images, tmp_path / "run", progress=interrupt)
    run = omnieval.open_run(tmp_path / "run")
    (images / "image60.png").write_bytes((images / "image0.png").read_bytes())
    assert len(what_is_opened(run)[2]) == 80  # what it had not come to may be another
    (images / "image5.png").write_bytes((images / "image0.png").read_bytes())
    assert described_until_refused(run, "are not those") == 39


def test_images_that_were_left_out_stay_left_out(images, tmp_path):
    good = (images / "image40.png").read_bytes()
    (images / "image40.png").write_bytes(b"")
    run = mapped(images, tmp_path / "run", skip_bad=True)
    (images / "image40.png").write_bytes(good)
    material, print_, _ = what_is_opened(run)
    assert [bad.file for bad in material.skipped] == ["image40.png"]
    assert len(material.frames) == len(run.steps) == 79
    assert print_ == run.manifest["dataset_fingerprint"]
    (images / "image41.png").write_bytes(b"")
    with pytest.raises(DatasetError, match=r"image41\.png"), reopened(run):
        pass


def test_that_nothing_had_to_be_left_out_is_remembered_too(images, tmp_path):
    assert what_is_opened(mapped(images, tmp_path / "asked", skip_bad=True))[0].skipped == ()
    assert what_is_opened(mapped(images, tmp_path / "unasked"))[0].skipped is None


def test_a_cut_of_a_cut_is_opened_as_it_was(images, tmp_path):
    run = mapped(load(images).cut(start=10, stride=2), tmp_path / "run", start=3, limit=15)
    material, _, _ = what_is_opened(run)
    assert [frame.file for frame in material.frames] == [f"image{number}.png" for number in range(16, 46, 2)]


def test_a_descriptor_of_ones_own_describes_again(images, own, tmp_path):
    run = mapped(images, tmp_path / "run", descriptor=f"{own}:Tiny")
    assert what_is_opened(run)[1] == run.manifest["dataset_fingerprint"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda file: file.write_text(TINY.replace("row.mean()", "row.max()")),
            r"tiny has changed since the run \(code",
        ),
        (lambda file: file.write_text(TINY.replace("Tiny", "Other")), "tiny cannot be made again: .* has no Tiny"),
        (lambda file: file.unlink(), "tiny cannot be made again: .*cannot read"),
    ],
)
def test_a_descriptor_that_is_another_now_is_refused(images, own, tmp_path, change, words):
    run = mapped(images, tmp_path / "run", descriptor=f"{own}:Tiny")
    change(own)
    with pytest.raises(ResultError, match=words), reopened(run):
        pass


def test_a_descriptor_that_was_an_object_is_refused_with_a_sentence(images, tmp_path):
    class Local:
        def describe(self, panorama):
            return omnieval.Description(panorama[:4].mean(axis=1), panorama[:4].mean(axis=1)[None])

    run = mapped(images, tmp_path / "run", descriptor=Local())
    with pytest.raises(ResultError, match="was an object in memory, not in a file or package"), reopened(run):
        pass
    with reopened(run, describe=False) as material:  # the pictures are there all the same
        assert len(list(material.described)) == 80
