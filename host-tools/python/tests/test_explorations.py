"""Explorations and the simulated world: those of the command line to the digit."""

import json

import numpy as np
import pytest

import tactus

THREE = ["3", "burlap", "T100"]


def identified(command, recordings, table, material, *more):
    at = ["--recordings", recordings.folder, "--table", table, "--material", material, "--format", "json"]
    return json.loads(command("identify", *at, *more))


@pytest.mark.parametrize("whose, learned", [("small", 2), ("biotac", 5)])
@pytest.mark.parametrize("method", ["fused", "paper"])
def test_an_exploration_is_the_commands_to_the_digit(whose, learned, method, request, command, tmp_path):
    recordings = request.getfixturevalue(whose)
    table = tactus.Table.learn(recordings, train_slides=learned, method=method)
    table.save(tmp_path / "table")
    for texture in recordings.textures[:6]:
        said = identified(command, recordings, tmp_path / "table", texture, "--method", method)
        slides = {
            tuple(np.float32(v) for v in (s.force_n, s.roughness_ln, s.fineness_unfiltered_ln)): s
            for s in recordings.measured_slides(texture)
        }
        explorer = tactus.Explorer(table, method=method)
        assert explorer.verdict() is None and explorer.posterior.shape == (len(table),)
        for step in said["slides"]:
            chosen = explorer.next_movement()
            for name in "force_n", "speed_mm_s", "property":
                assert chosen[name] == step[name]
            assert chosen["uncertainty"] == step["expected_uncertainty"]
            if step["rejected"]:
                explorer.reject(chosen["force_n"], chosen["speed_mm_s"])
                continue
            key = tuple(np.float32(step[name]) for name in ("force_n", "roughness_ln", "fineness_ln"))
            explorer.update(slides[key])
            ours = dict(zip(explorer.textures, explorer.posterior))
            for candidate in step["posterior"]:
                assert ours[candidate["texture"]] == np.float32(candidate["probability"])
        assert (explorer.verdict() or explorer.best()) == said["verdict"]
        assert explorer.slides == said["verdict"]["slides"]
        explorer.restart()
        assert explorer.slides == 0


def test_what_an_explorer_cannot_take_is_refused(small):
    table = tactus.Table.learn(small, train_slides=2)
    with pytest.raises(KeyError, match="velvet"):
        tactus.Explorer(table, among=["velvet"])
    with pytest.raises(tactus.TableError):
        tactus.Explorer(table, method="paper")
    with pytest.raises(tactus.TableError):
        # the table compares traction
        tactus.Explorer(table, measures=["roughness", "fineness"])
    explorer = tactus.Explorer(table, among=small.textures[:2])
    assert explorer.posterior.tolist()[:2] == [0.5, 0.5]
    slide = small.slides(small.textures[0])[0]
    elsewhere = tactus.features(slide.pac, window_s=slide.window_s, force_n=0.7, speed_mm_s=20, still=slide.still)
    with pytest.raises(ValueError, match="does not have the movement 0.70 N"):
        explorer.update(elsewhere)
    with pytest.raises(ValueError, match="none of traction"):
        explorer.update(slide.features(), "beauty")


def test_an_explorer_outlives_its_table(small):
    explorer = tactus.Explorer(tactus.Table.learn(small, train_slides=2))
    others = [bytes(2000) for _ in range(100)]
    explorer.update(small.measured_slides(small.textures[3])[2])
    assert explorer.best()["texture"] == small.textures[3] and others


def test_a_verification_is_the_commands(biotac, command, tmp_path):
    table = tactus.Table.learn(biotac)
    table.save(tmp_path / "table")
    for material in biotac.textures[:2]:
        at = ["--table", tmp_path / "table", "--texture", biotac.textures[0], "--sample", biotac.folder]
        said = json.loads(command("verify", *at, "--material", material, "--format", "json"))
        # the command leaves the slides out that the table was learned from
        ours = tactus.verify(table, biotac.textures[0], biotac.measured_slides(material)[5:])
        assert ours[-1]["false_accept"] == pytest.approx(said["false_accept"], rel=1e-5)
        assert [(o["score"], o["limit"], o["answer"].lower()) for o in ours] == [
            (s["score"], s["limit"], s["answer"]) for s in said["slides"]
        ]
        assert ours[-1]["answer"].lower() == said["answer"]
    with pytest.raises(tactus.TableError):
        tactus.verify(tactus.Table.learn(biotac, method="paper"), biotac.textures[0], biotac.measured_slides(1))


def test_simulated_slides_are_the_commands(command, tmp_path):
    command("simulate", "--out", tmp_path / "world", "--textures", ",".join(THREE), "--trials", 2, "--seed", 4)
    theirs = tactus.Recordings(tmp_path / "world")
    ours = tactus.simulate(THREE, trials=2, seed=4)
    assert list(ours) == theirs.textures and len(theirs) == len(ours) * 3 * 2
    for name, slides in ours.items():
        for our, their in zip(slides, theirs.slides(name)):
            assert our.number == their.number and our.texture == their.texture == name
            for samples in "pac", "still", "pdc", "shear_mn":
                np.testing.assert_array_equal(getattr(our, samples), getattr(their, samples))


def test_a_simulated_rig_explores(command):
    known = tactus.simulate([*THREE, "47", "marble"], trials=3)
    table = tactus.Table.learn_slides({name: [s.features() for s in slides] for name, slides in known.items()})
    rig = tactus.SimulatedRig("burlap")
    assert rig.texture == "Burlap" and rig.time_s > 0
    explorer = tactus.Explorer(table)
    while explorer.verdict() is None:
        chosen = explorer.next_movement()
        slide = rig.slide(chosen["force_n"], chosen["speed_mm_s"])
        explorer.update(slide.features())
    assert explorer.verdict()["told"] == "sure" and explorer.verdict()["texture"] == "Burlap"
    with pytest.raises(tactus.SlideError, match="9000 mN"):
        rig.slide(9, 10)
    with pytest.raises(KeyError, match="velcro tape of nobody"):
        tactus.SimulatedRig("velcro tape of nobody")
    with pytest.raises(tactus.TableError, match="takes at least two"):
        tactus.Table.learn_slides({"one": [slide.features()]})
