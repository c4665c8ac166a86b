// The 95 % intervals of a calibration as lines that a plot can draw. Made by stillpoint config layout.
import { Input } from "./types";

export const inputs = ["CALIBRATION_TOPIC"];
export const output = "/studio_script/bandsPLACE";

type Band = { low: number; value: number; high: number };
type Axes = { x: Band; y: Band; z: Band };
type Header = { stamp: { sec: number; nsec: number }; frame_id: string };
type Bands = { header: Header; bias: Axes; scale: Axes };
type Vector = { x: number; y: number; z: number };

const band = (value: number, std: number): Band => ({ low: value - 1.96 * std, value, high: value + 1.96 * std });
const axes = (value: Vector, std: Vector): Axes => ({
  x: band(value.x, std.x),
  y: band(value.y, std.y),
  z: band(value.z, std.z),
});

export default function script(event: Input<"CALIBRATION_TOPIC">): Bands {
  const message = event.message as any;
  const triad = message.accelerometer;
  // 0 is UNDETERMINED: there is nothing to draw. Without a message, Lichtblick warns that the script is wrong.
  const nothing = { x: NaN, y: NaN, z: NaN };
  const [bias, scale] =
    triad?.status && triad.bias && triad.scale
      ? [axes(triad.bias, triad.bias_std), axes(triad.scale, triad.scale_std)]
      : [axes(nothing, nothing), axes(nothing, nothing)];
  return { header: message.header, bias, scale };
}
