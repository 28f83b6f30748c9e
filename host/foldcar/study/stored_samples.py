"""The samples of one environment in the store: its scenes and its cars' variations, drawn as they are needed.

Input: an environment and a store. Output: rows of `sample` and `draw`. Before scenes are added to stored
ones two of those are drawn again: where these are others, the new ones would be of another environment.
"""

import json

from foldcar.store.writer import StoreWriter, canonical_json
from foldcar.study.environments import Environment


class StoredSamples:
    """``dynamic`` says whether the program runs beside the simulation."""

    def __init__(self, environment: Environment, writer: StoreWriter, dynamic: bool) -> None:
        self._environment, self._writer, self._dynamic = environment, writer, dynamic
        self._environment_id = writer.environment(environment.fingerprint)
        self._spread_id = writer.spread(environment.spread_fingerprint)
        self._scenes = self._first_scenes = writer.sample_count(self._environment_id)
        self._draws = writer.draw_count(self._spread_id)

    def reach(self, sample: int) -> None:
        """Store what is not there of all samples up to this one. FoldcarError if the program is at fault."""
        environment, writer = self._environment, self._writer
        if sample >= self._scenes == self._first_scenes:
            # The last first: what depends on the number of samples drawn before then shows.
            for k in sorted({self._scenes - 1, 0} if self._scenes else (), reverse=True):
                self._confirm(k)
        for k in range(self._scenes, sample + 1):
            if k.bit_count() == 1:
                # Now and then, for what differs by chance: it raises if sample 0 is another than the first time.
                environment.sample(0)
            scene = environment.sample(k)
            writer.put_sample(self._environment_id, k, scene, environment.scene_identity(k, self._dynamic))
            self._scenes = k + 1
        for k in range(self._draws, sample + 1):
            writer.put_draw(self._spread_id, k, environment.variation(k), environment.variation_identity())
            self._draws = k + 1

    def _confirm(self, k: int) -> None:
        from foldcar.scenes.source import other_scene

        stored = self._writer.stored_scene(self._environment_id, k)
        if stored != json.loads(canonical_json(self._environment.sample(k))):
            raise other_scene(self._environment.program, k)
