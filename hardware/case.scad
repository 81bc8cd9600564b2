// The handheld's case: board, batteries and display on a load cell whose tip touches. Millimetres.
// openscad -D 'part="body"' -o body.stl hardware/case.scad
// part: "body", "lid", or "assembly" to look at.
part = "assembly";

wall = 2.4;
board = [133.4, 70, 24];     // NUCLEO-F429ZI with its headers
battery = [108, 62, 18];     // holder of six AA side by side, with its clip: measure yours
cell = [80, 12.7, 12.7];     // as in finger.scad
cell_holes = 15;
cell_screw = 5.3;            // clearance of M5, at the end that is held
tip_below = 14.2;            // how far the tip stands out below the cell: flange, skirt and rise in finger.scad
optics = 25;                 // PAA5100JE above the surface, its data sheet: 15 to 35
optics_board = [26, 26, 2];
window = [24, 13];           // the display's lit part
button = 12.2;
rocker = [19.4, 13.2];       // switch KCD1
sound = 12.2;                // buzzer
usb = [10, 8];
gap = 0.6;

$fn = 64;
inside = [board[0] + 2 * gap, board[1] + 2 * gap, board[2] + battery[2] + 6];
outside = [inside[0] + 2 * wall, inside[1] + 2 * wall, inside[2] + wall];
// The cell lies below the floor, its free end forward, so that nothing of the case touches it.
cell_front = outside[0] - 6;
standoff = 1.6;
channel = [cell[0] + 8, cell[1] + 8, cell[2] + 4];

module rounded(size, r) {
  hull() for (x = [r, size[0] - r], y = [r, size[1] - r]) translate([x, y, 0]) cylinder(r = r, h = size[2]);
}

module body() {
  difference() {
    union() {
      rounded(outside, 6);
      // walls beside the cell: nobody grips it by mistake; they end above the tip
      translate([cell_front - channel[0], outside[1] / 2 - channel[1] / 2 - wall, -channel[2]])
        cube([channel[0], channel[1] + 2 * wall, channel[2] + wall]);
    }
    difference() {
      translate([wall, wall, wall]) rounded([inside[0], inside[1], inside[2] + 1], 4);
      // what the lid is screwed into
      posts() cylinder(d = 8, h = inside[2]);
    }
    difference() {
      translate([cell_front - channel[0] - 1, outside[1] / 2 - channel[1] / 2, -channel[2] - 1])
        cube([channel[0] + 2, channel[1], channel[2] + 1]);
      // the cell stands off the floor by this pad, and bends freely
      translate([cell_front - cell[0] - 1, outside[1] / 2 - cell[1] / 2, -standoff]) cube([cell_holes + 15, cell[1], standoff + 1]);
    }
    // the cell's held end
    for (x = [0, cell_holes]) translate([cell_front - cell[0] + 8 + x, outside[1] / 2, -standoff - 1]) cylinder(d = cell_screw, h = wall + standoff + 2);
    // the stop, M3, above the cell's free end, between its two screws: turned down until a gap of a sheet of paper is left
    translate([cell_front - 10, outside[1] / 2, -1]) cylinder(d = 2.6, h = wall + 2);
    // cable of cell and tip
    translate([cell_front - cell[0] - 6, outside[1] / 2 - 4, -1]) cube([5, 8, wall + 2]);
    // what the optical sensor looks through, beside the tip
    translate([cell_front - 24, outside[1] / 2 + channel[1] / 2 + wall + 2, -1]) cube([20, 20, wall + 2]);
    // USB at the back, and the switch
    translate([-1, outside[1] / 2 - usb[0] / 2, wall + battery[2] + 6]) cube([wall + 2, usb[0], usb[1]]);
    translate([20, -1, wall + 6]) cube([rocker[0], wall + 2, rocker[1]]);
    // the lid's screws
    posts() cylinder(d = 2.6, h = 200);
  }
  // the board's ledge, above the batteries
  for (x = [wall, wall + inside[0] - 6]) translate([x, wall, wall]) difference() {
    cube([6, inside[1], battery[2] + 2]);
    translate([-1, 12, -1]) cube([8, inside[1] - 24, battery[2] + 4]);
  }
  // the optical sensor's ledge
  translate([cell_front - 27, outside[1] / 2 + channel[1] / 2 + wall - 1, wall]) difference() {
    cube([optics_board[0] + 4, 24, max(1, optics - tip_below - cell[2] - standoff)]);
    translate([4, 2, -1]) cube([optics_board[0] - 4, 20, 30]);
  }
}

module posts() {
  for (x = [5, outside[0] - 5], y = [5, outside[1] - 5]) translate([x, y, 8]) children();
}

module lid() {
  difference() {
    union() {
      rounded([outside[0], outside[1], wall], 6);
      translate([wall + gap, wall + gap, -3]) difference() {
        rounded([inside[0] - 2 * gap, inside[1] - 2 * gap, 3], 4);
        translate([2, 2, -1]) rounded([inside[0] - 2 * gap - 4, inside[1] - 2 * gap - 4, 5], 3);
      }
    }
    translate([outside[0] * 0.62, outside[1] / 2 - window[1] / 2, -1]) cube([window[0], window[1], wall + 2]);
    translate([outside[0] * 0.40, outside[1] / 2, -1]) cylinder(d = button, h = wall + 2);
    for (a = [0 : 60 : 300]) translate([outside[0] * 0.18 + cos(a) * sound / 3, outside[1] / 2 + sin(a) * sound / 3, -1]) cylinder(d = 1.6, h = wall + 2);
    translate([0, 0, -10]) posts() cylinder(d = 3.4, h = 20);
  }
}

module assembly() {
  color("SteelBlue") body();
  translate([0, 0, outside[2] + 12]) color("LightSteelBlue") lid();
  translate([0, 0, -cell[2] - standoff]) color("Silver") translate([cell_front - cell[0], outside[1] / 2 - cell[1] / 2, 0]) cube(cell);
  color("BurlyWood") translate([cell_front + 8, outside[1] / 2, -cell[2] - standoff - tip_below]) cylinder(d = 20, h = tip_below - 3);
  color("DimGray") translate([cell_front - 25, outside[1] / 2 - cell[1] / 2, -cell[2] - standoff - 3]) cube([41, cell[1], 3]);
}

if (part == "body") body();
if (part == "lid") rotate([180, 0, 0]) lid();
if (part == "assembly") assembly();
