//! What may be wrong with a rig that was just built, and what to do about it.

/// A mistake that the bring-up knows by what it sees.
#[derive(Debug)]
pub struct Mistake {
    /// Its name for programs.
    pub key: &'static str,
    /// The mistake.
    pub what: &'static str,
    /// The remedy.
    pub remedy: &'static str,
}

/// A mistake, and where.
#[derive(Clone, Debug)]
pub struct Named {
    /// Which.
    pub mistake: &'static Mistake,
    /// The part, the pin; nothing where the mistake says it.
    pub place: &'static str,
}

macro_rules! mistakes {
    ($(#[$doc:meta])* $all:ident: $($name:ident = $key:literal: $what:literal, $remedy:literal;)*) => {
        $(pub(super) static $name: Mistake = Mistake { key: $key, what: $what, remedy: $remedy };)*
        $(#[$doc])*
        pub static $all: &[&Mistake] = &[$(&$name),*];
    };
}

mistakes! {
    /// Those of a rig, in the order in which the steps look for them.
    MISTAKES:
    SUPPLY = "supply": "a supply is not what it should be",
        "Measure it again at the pin that is named, everything connected; replace the supply or find what pulls it \
             down";
    RESET = "reset": "the firmware gave up before",
        "Report the last words; power the board off and on, and begin again";
    CLOCK = "clock": "the 8 MHz of the ST-LINK are not there, or the core does not run by them",
        "Leave the ST-LINK's half on the board, and its solder bridges (MCO to PH0) as delivered; see UM1974";
    PA12 = "pa12": "PA12 is high",
        "Take the plug out of the USB user connector CN13, and whatever else hangs on PA12";
    BROWN_OUT = "brown-out": "the chip's brown-out level is not set",
        "Once: STM32_Programmer_CLI -c port=SWD -ob BOR_LEV=0";
    TIED_HIGH = "tied-high": "a switch's pin is tied to 3.3 V",
        "A switch leads from its pin to ground, and nowhere else";
    ENCODER_LINE = "encoder-line": "nothing drives a line of the encoder",
        "Look for the line between encoder and board; the encoder's outputs must be push-pull, 3.3 V";
    ENCODER_SILENT = "encoder-silent": "nothing drives the encoder's lines",
        "Give the encoder its supply and ground; its lines belong to PD12 and PD13";
    DATA_EXCHANGED = "data-exchanged": "the sensor's MISO and MOSI are exchanged",
        "The sensor's output belongs to PA6, its input to PB5";
    SENSOR_SILENT = "sensor-silent": "no sensor answers",
        "Its supply of 3.3 V and ground, chip select PD14, clock PA5, its output at PA6; measure each at the \
             sensor's end of the cable";
    MISO_STUCK = "miso-stuck": "MISO is tied to a level",
        "Look for a short of PA6 to ground or to 3.3 V in cable and plug";
    PULL_MISSING = "pull-missing": "a resistor is missing that holds a pin while the chip is in reset",
        "10 kohm to ground at PE13 and at PC8, 10 kohm to 3.3 V at PD14";
    WORDS = "words": "words of the sensor are damaged or late",
        "Shorten the cable, a ground beside SCK, 33 ohm in SCK at the board; then halve the bus (the rig's page)";
    SENSOR_STILL = "sensor-still": "P_AC is too quiet: the sensor does not convert",
        "Power the sensor off and on; replace it if it stays so";
    SENSOR_NOISY = "sensor-noisy": "P_AC is too noisy",
        "Leave the finger alone; one ground for sensor, board and motors; for a mems, what `words` asks for";
    SENSOR_FILLING = "sensor-filling": "P_DC is out of its range without contact",
        "Refill the finger as its manual says; keep off whatever presses it";
    SWITCH_OPEN = "switch-open": "a switch reads as open, pressed or not",
        "Its wire is broken, or leads nowhere: from the pin by the switch to ground, normally closed";
    SWITCH_KIND = "switch-kind": "a switch closes when it is pressed",
        "Use its other contact: normally closed, so that a broken wire reads as pressed";
    SWITCH_CLOSED = "switch-closed": "a switch reads as closed, pressed or not",
        "It is bridged, or its pin is shorted to ground, or another switch was pressed";
    SWITCHES_EXCHANGED = "switches-exchanged": "another switch opens than the one that is pressed",
        "Exchange their wires";
    SWITCHES_JOINED = "switches-joined": "another switch opens with the one that is pressed",
        "Each switch leads from a pin of its own to ground by a wire of its own";
    STOP_SUPPLY = "stop-supply": "the emergency stop leaves the motors their supply",
        "Put its second contact into the supply of both motors' drivers";
    ENCODER_EXCHANGED = "encoder-exchanged": "the encoder counts down to the right",
        "Exchange its lines A and B";
    ENCODER_LINES = "encoder-lines": "the encoder has another resolution than 1000 counts a mm",
        "2500 lines on a screw of 10 mm; or a firmware of your own constants (Another board)";
    CURRENT_OPEN = "current-open": "the amplifier of the motor's current is not connected to PA3, or at its end",
        "Its output belongs to PA3, its supply is 3.3 V, its reference half of that";
    CURRENT_OFFSET = "current-offset": "the amplifier of the motor's current is not at half of 3.3 V without current",
        "Its reference pins: one to 3.3 V, one to ground (INA240)";
    CURRENT_NOISE = "current-noise": "the motor's current is noisy at rest",
        "1 kohm and 100 nF at PA3; the amplifier's inputs as a pair to the shunt";
    FINGER_DEAD = "finger-dead": "P_DC does not rise when the finger is squeezed",
        "Squeeze harder; if it stays so its amplifier or its cable is dead: replace the sensor";
    STOPPED = "stopped": "a motor was stopped before its way was over",
        "See why it was stopped, remove the cause, and run the step again";
    LEVER_STILL = "lever-still": "the lever does not move",
        "Both coils of its motor, the driver's supply and its current; STEP PE9, EN PE13 (high is on)";
    LEVER_DIR = "lever-dir": "the lever goes down where it should go up",
        "Exchange the two wires of one coil; or invert DIR (PE11, high is down)";
    LEVER_STEPS = "lever-steps": "the lever loses steps",
        "Raise the driver's current (never beyond what lifts 5 N), oil the screw, align it";
    LEVER_SCALE = "lever-scale": "the lever makes another way of a step than 0.625 um",
        "1/16 step at the driver's MS pins, 200 steps a turn, a lead of 2 mm";
    STAGE_STILL = "stage-still": "the stage's motor gets no current",
        "The bridge's EN (PC8, high is on), its supply, its PWM (PC6), the motor's wires";
    STAGE_STUCK = "stage-stuck": "the stage's motor has current, and the stage stands",
        "Something holds it: transport locks, cable, alignment of the screw";
    STAGE_REVERSED = "stage-reversed": "the stage goes to the left where it should go to the right",
        "Exchange the two wires of its motor";
    BRIDGE_EXCHANGED = "bridge-exchanged": "PWM and DIR of the bridge are exchanged",
        "PWM is PC6, DIR is PC7: exchange them at the bridge";
    CURRENT_REVERSED = "current-reversed": "the motor's current reads with the wrong sign",
        "Exchange the amplifier's two inputs";
    BRIDGE_DECAY = "bridge-decay": "the bridge is off while its PWM is low (fast decay), and does not brake",
        "It must short the motor then (slow decay): look for that input of the bridge, or take another one";
    MOTOR_CONNECTED = "motor-connected": "the stage's motor is still connected",
        "Take its two wires off the bridge, and put the resistor there";
    CURRENT_GAIN = "current-gain": "the amplifier of the motor's current has another gain than 1 V/A",
        "INA240A1 (20 V/V) and a shunt of 50 mohm; A2 has 50 V/V, A3 100, A4 200";
    SCALE_LINE = "scale-line": "P_DC and the weights are on no line",
        "Each weight rests on the tip alone and stands still, the finger held so that it does not give way; weigh \
             again";
    SCALE_FAR = "scale-far": "a count of P_DC is worth another force than a finger's can be",
        "5.75 to 23 mN a count are possible: see whether the weights are g; else the finger's filling or its \
             amplifier is wrong";
    FINGER_LEAKS = "finger-leaks": "P_DC falls under a weight that stands, or does not come back after it",
        "Wait a minute and weigh again; if it stays so, look for fluid at the skin's rim and refill the finger";
    ZERO_DRIFTS = "zero-drifts": "P_DC in the air is not the same twice",
        "A finger warms up for a quarter of an hour; keep the sun off it; if it stays so the skin leaks";
    STAGE_SPEED = "stage-speed": "the stage does not keep the speed that it is asked for",
        "Oil and align its screw, look for what drags on it or its cables, and whether the bridge's supply holds 12 \
             V meanwhile";
    SAMPLES_LOST = "samples-lost": "the firmware lost samples",
        "Report it, with the log (tactus device status --log FILE)";
    SLIDE_QUIET = "slide-quiet": "the finger hears nothing of the slide",
        "See whether it touches the paper and the stage moves below it; fix the paper to the stage";
    SLIDE_TRACTION = "slide-traction": "the stage's motor pulls no harder with the finger on it",
        "See whether the finger touches the paper, and run step `resistor` again: a wrong gain or sign";
    FAULT = "fault": "the rig's firmware refused, or saw a fault",
        "Remove the cause that it names, then: tactus device home, and the same command again";
    STORE = "store": "the store does not keep what is written",
        "Report what it says; the rig works, but forgets at power-off";
    WATCHDOG = "watchdog": "the watchdog does not start the board again",
        "Replace the board";
}

mistakes! {
    /// Those of bare boards, of handhelds, and of fingers that are no BioTac.
    OTHER_MISTAKES:
    LINK = "link": "answers of the board are lost or damaged",
        "Another USB cable, straight into the PC; no other program at the port";
    KERNEL = "kernel": "the chip computes other results by its kernels than by their plain twins",
        "Flash the image again; if it stays so, report it, and do not use the board";
    CYCLES = "cycles": "the chip takes more cycles than the model and 30 %",
        "Report it, with the report";
    TIMER = "timer": "a timer or the converter does not keep its period",
        "Power the board off and on; if it stays so, report it, and do not use the board";
    FLASH = "flash": "the flash does not take, keep or erase data, or its last sector is not blank",
        "Erase that sector with STM32CubeProgrammer; if it stays so, replace the board";
    CONVERTER_INPUT = "converter-input": "the converter's CH1 is not at 3.3 V",
        "Its pin 3 belongs to 3V3, its pin 2 to the potentiometer's middle: see whether they are exchanged";
    POTENTIOMETER = "potentiometer": "the potentiometer does not reach both ends",
        "Its middle belongs to CH0, one end to 3V3, the other one to GND; turn it as far as it goes";
    PART = "part": "a part of the finger does not answer as it must",
        "The part that is named: its power, ground and chip select (IIS3DWB PD14, ADS1220 PD15), then its other wires";
    CELL = "cell": "the load cell is at an end of its range",
        "Its four wires: two of the supply, two of the signal; then the amplifier's supply and reference";
    DISPLAY_SILENT = "display-silent": "the display does not answer",
        "Its supply of 3.3 V and ground, SCL PB8, SDA PB9 (exchanged?), and address 0x3C";
    DISPLAY_DARK = "display-dark": "the display answers and stays dark",
        "Replace it: an SSD1306 of 128 x 64 points";
    BUTTON_DEAD = "button-dead": "the button does nothing",
        "It leads from PC13 to 3.3 V while it is pressed";
    BUTTON_STUCK = "button-stuck": "the button is pressed, or its pin tied to 3.3 V",
        "Look for a short of PC13 to 3.3 V, and for a button that sticks";
    BUZZER = "buzzer": "the buzzer is silent",
        "A passive one, from PC9 to ground";
}
