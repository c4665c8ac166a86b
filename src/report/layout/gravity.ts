// Which way was up in the sensor's frame during each rest, one unit a g, and the faces: full ones were seen.
// Made by stillpoint config layout.
import { SceneUpdate } from "@foxglove/schemas";
import { Input } from "./types";

export const inputs = ["SEGMENT_TOPIC", "COVERAGE_TOPIC"];
export const output = "/studio_script/gravityPLACE";

type Vector = { x: number; y: number; z: number };

const point = { position: { x: 0, y: 0, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } };
const seen = { r: 0.0, g: 0.45, b: 0.7, a: 0.9 };
const missing = { r: 0.6, g: 0.6, b: 0.6, a: 0.25 };
const rejected = { r: 0.84, g: 0.37, b: 0.0, a: 0.9 };

const entity = (id: string) => ({
  timestamp: { sec: 0, nsec: 0 },
  frame_id: "FRAME",
  id,
  lifetime: { sec: 0, nsec: 0 },
  frame_locked: true,
  metadata: [],
  arrows: [],
  cubes: [],
  spheres: [] as SceneUpdate["entities"][0]["spheres"],
  cylinders: [],
  lines: [] as SceneUpdate["entities"][0]["lines"],
  triangles: [],
  texts: [] as SceneUpdate["entities"][0]["texts"],
  models: [],
});

export default function script(
  event: Input<"SEGMENT_TOPIC"> | Input<"COVERAGE_TOPIC">,
): SceneUpdate | undefined {
  const message = event.message as any;
  if (event.topic === "SEGMENT_TOPIC") {
    const mean = (message.means as any[]).find((triad) => triad.sensor === "accelerometer");
    if (!mean) {
      return undefined;
    }
    const { x, y, z } = mean.mean as Vector;
    const tip = { x: x / 9.80665, y: y / 9.80665, z: z / 9.80665 };
    const start = message.start;
    const rest = entity(`rest ${start.sec ?? start.seconds}.${start.nsec ?? start.nanosec ?? start.nanos}`);
    rest.lines.push({
      type: 0,
      pose: point,
      thickness: 2,
      scale_invariant: true,
      points: [{ x: 0, y: 0, z: 0 }, tip],
      color: message.accepted ? seen : rejected,
      colors: [],
      indices: [],
    });
    return { deletions: [], entities: [rest] };
  }
  const faces = entity("faces");
  for (const face of message.faces as { name: string; normal: Vector; placements: number }[]) {
    const pose = { position: face.normal, orientation: point.orientation };
    const color = face.placements > 0 ? seen : missing;
    faces.spheres.push({ pose, size: { x: 0.16, y: 0.16, z: 0.16 }, color });
    // Beside its sphere as one looks at it from a side, whichever way the normal points.
    const { x, y, z } = face.normal;
    const label = { x, y, z: z + (z < -0.5 ? -0.3 : 0.3) };
    faces.texts.push({
      pose: { position: label, orientation: point.orientation },
      billboard: true,
      font_size: 14,
      scale_invariant: true,
      color: { r: 0.1, g: 0.1, b: 0.1, a: 1 },
      text: face.placements > 0 ? `${face.name} ×${face.placements}` : face.name,
    });
  }
  return { deletions: [], entities: [faces] };
}
