// Small pictures of environments: from above, and the ground under both tracks from start to goal.

async function drawSample(canvas, name, data) {
  const ground = await readGround(name, data.ground, data.units);
  if (!ground) return;
  const { context, scale } = drawScene(canvas, ground, topWindow(ground, []), 220, false);
  canvas.dataset.drawn = String(Math.round(scale));
  return context;
}

// The ground under a middling car's wheels along the straight way; heights are stretched.
async function drawWay(canvas, name, data) {
  const ground = await readGround(name, data.ground, data.units);
  if (!ground) return;
  const { start, goal } = ground.scene;
  const context = freshContext(canvas, 46);
  const width = canvas.clientWidth;
  const heading = goal?.heading_rad ?? (goal ? Math.atan2(goal.y_m - start.y_m, goal.x_m - start.x_m) : start.heading_rad);
  const track = data.cars.find((car) => car)?.track_m ?? 0.11;
  const lines = [0.5, -0.5].map((side) => {
    const heights = [];
    for (let pixel = 0; pixel <= width; pixel++) {
      const along = ground.x_min_m - start.x_m + ((ground.x_max_m - ground.x_min_m) * pixel) / width;
      const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
      heights.push(ground.height(start.x_m + along * cos - side * track * sin, start.y_m + along * sin + side * track * cos));
    }
    return heights;
  });
  const low = Math.min(0, ...lines.flat());
  const high = Math.max(low + 0.01, ...lines.flat());
  const place = (pixel, z) => [pixel, 40 - ((z - low) / (high - low)) * 34];
  const [left, right] = lines.map((line) => line.map((z, pixel) => place(pixel, z)));
  polygon(context, [...right, [width, 46], [0, 46]], "#e5dac0", null);
  polyline(context, right, "#6b4a17", 1.4);
  polyline(context, left, RUN_COLOUR, 1.2, [4, 3]);
  label(context, `${Math.round(1000 * (high < 0 ? 0 : high))} mm`, width - 4, 9, "right");
}
