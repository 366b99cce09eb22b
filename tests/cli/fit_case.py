"""What the tests of vsplat fit share: pictures of a solid, and a scene to start from."""
import json
import math

import support


class FitCase(support.Case):
    """Pictures of a random solid, and a grey ball in its place."""
    SIDE = 24

    def setUp(self):
        super().setUp()
        self.succeeds("dataset", "procedural", "--count", 1, "--solids", "--output", self.path("set"), "--views", 5, "--size", self.SIDE, "--seed", 4)
        self.photos = self.path("set", "solid_0000")
        self.ball = self.path("ball.ply")
        spots = [(0.25 * math.sin(i), 0.25 * math.cos(2.3 * i), 0.25 * math.sin(5.1 * i)) for i in range(60)]
        support.write_scene(self.ball, [(at, (0.5, 0.5, 0.5), 0.06, 0.7) for at in spots])

    def fit(self, *more, start=None, output="out.ply"):
        return ("fit", self.photos, "--start", start or self.ball, "--output", self.path(output), "--quiet", *more)

    def json_of(self, *arguments):
        return json.loads(self.succeeds(*arguments, "--json")[0])
