//! Tapes written by hand: what they do, and what is refused of them.

use plyflow_tape::{Builder, Call, Id, Operation, Row, Store, Table, Tape};

fn row(buffer: u16, row: u16) -> Row {
    Row { buffer, row }
}

/// `y = |x| < 2 ? sqrt(x x + 1) : -x`, with `scale` for all lanes: `z = scale x`.
fn by_hand() -> Tape {
    let mut b = Builder::new();
    let (x, scale, y) = (
        b.buffer("x", 1, false),
        b.buffer("scale", 1, true),
        b.buffer("y", 2, false),
    );
    let at = b.push(Operation::Load(row(x, 0)));
    let factor = b.push(Operation::Load(row(scale, 0)));
    let (one, two) = (b.constant(1.0), b.constant(2.0));
    let square = b.push(Operation::Multiply(at, at));
    let sum = b.push(Operation::Add(square, one));
    let root = b.push(Operation::Root(sum));
    let size = b.push(Operation::Magnitude(at));
    let small = b.push(Operation::Less(size, two));
    let minus = b.push(Operation::Negate(at));
    let chosen = b.push(Operation::Select(small, root, minus));
    let scaled = b.push(Operation::Multiply(factor, at));
    b.finish([(row(y, 0), chosen), (row(y, 1), scaled)])
}

#[test]
fn a_tape_does_to_each_lane_what_it_says_and_counts_its_choices() {
    let tape = by_hand();
    tape.check().expect("it keeps the rules");
    let (mut x, mut scale, mut y) = ([0.0, -1.5, 3.0], [10.0], [0.0; 6]);
    let taken = tape.run(3, &mut [&mut x, &mut scale, &mut y]);
    assert_eq!(y, [1.0, 3.25f64.sqrt(), -3.0, 0.0, -15.0, 30.0]);
    assert_eq!(taken, [[2, 1]]);
}

#[test]
fn what_is_asked_twice_stands_once_constants_are_folded_and_the_dead_are_left_out() {
    let mut b = Builder::new();
    let (x, y) = (b.buffer("x", 2, false), b.buffer("y", 1, false));
    let at = b.push(Operation::Load(row(x, 0)));
    b.push(Operation::Load(row(x, 1)));
    let (two, three) = (b.constant(2.0), b.constant(3.0));
    let six = b.push(Operation::Multiply(two, three));
    let (one, other) = (
        b.push(Operation::Add(at, six)),
        b.push(Operation::Add(at, six)),
    );
    assert_eq!(one, other);
    let both = b.push(Operation::Multiply(one, other));
    let tape = b.finish([(row(y, 0), both)]);
    let six = Operation::Constant(6f64.to_bits());
    let load = Operation::Load(row(x, 0));
    let [a, b, c] = [0, 1, 2].map(Id);
    assert_eq!(
        tape.operations,
        [load, six, Operation::Add(a, b), Operation::Multiply(c, c)]
    );
}

#[test]
fn a_search_finds_the_last_row_that_is_not_above() {
    let mut rows = [[f64::INFINITY; 8]; 4];
    for (i, x) in [0.0, 1.0, 4.0].into_iter().enumerate() {
        rows[i][..2].copy_from_slice(&[x, 10.0 * i as f64]);
    }
    let mut b = Builder::new();
    let (x, y) = (b.buffer("x", 1, false), b.buffer("y", 1, false));
    let table = b.table(&rows, 2);
    let at = b.push(Operation::Load(row(x, 0)));
    let place = b.push(Operation::Find(table, at));
    let found = b.push(Operation::Entry(table, place, 1));
    let tape = b.finish([(row(y, 0), found)]);
    tape.check().expect("it keeps the rules");
    let (mut x, mut y) = ([-1.0, 0.0, 0.9, 1.0, 3.9, 4.0, 1e300, f64::NAN], [0.0; 8]);
    tape.run(8, &mut [&mut x, &mut y]);
    assert_eq!(y, [0.0, 0.0, 0.0, 10.0, 10.0, 20.0, 20.0, 0.0]);
}

/// `f = 3 law(2 x)` with a history of the law.
fn asks() -> Tape {
    let mut b = Builder::new();
    let (x, past, f) = (
        b.buffer("x", 1, false),
        b.buffer("past", 2, false),
        b.buffer("f", 1, false),
    );
    let at = b.push(Operation::Load(row(x, 0)));
    let before = [0, 1].map(|r| b.push(Operation::Load(row(past, r))));
    let (two, three) = (b.constant(2.0), b.constant(3.0));
    let double = b.push(Operation::Multiply(two, at));
    let call = b.call(Call {
        of: "law".into(),
        arguments: vec![
            ("e".into(), vec![double]),
            ("history".into(), before.to_vec()),
        ],
        results: vec![("s".into(), 1), ("history".into(), 2)],
    });
    let answer = b.push(Operation::Result(call, 0, 0));
    let after = [0, 1].map(|r| b.push(Operation::Result(call, 1, r)));
    let threefold = b.push(Operation::Multiply(three, answer));
    b.finish([
        (row(f, 0), threefold),
        (row(past, 0), after[0]),
        (row(past, 1), after[1]),
    ])
}

/// `s = e + history[0]`, `history[0] = e`; the second row stays.
fn law() -> Tape {
    let mut b = Builder::new();
    let (e, history, s) = (
        b.buffer("e", 1, false),
        b.buffer("history", 2, false),
        b.buffer("s", 1, false),
    );
    let (now, before) = (
        b.push(Operation::Load(row(e, 0))),
        b.push(Operation::Load(row(history, 0))),
    );
    let sum = b.push(Operation::Add(now, before));
    b.finish([(row(s, 0), sum), (row(history, 0), now)])
}

#[test]
fn a_tape_goes_into_the_one_that_calls_it() {
    let (asks, law) = (asks(), law());
    asks.check().expect("it keeps the rules");
    let whole = asks
        .with_calls(|name| (name == "law").then_some(&law))
        .expect("one tape");
    assert!(whole.calls.is_empty());
    whole.check().expect("it keeps the rules");
    let (mut x, mut past, mut f) = ([1.0, 5.0], [10.0, 20.0, 7.0, 8.0], [0.0; 2]);
    whole.run(2, &mut [&mut x, &mut past, &mut f]);
    assert_eq!((f, past), ([36.0, 90.0], [2.0, 10.0, 7.0, 8.0]));

    let missing = asks.with_calls(|_| None).expect_err("no tape");
    assert_eq!(missing.0, "there is no tape for 'law'");
    let other = by_hand();
    let unlike = asks.with_calls(|_| Some(&other)).expect_err("another one");
    assert_eq!(
        unlike.0,
        "'law': it reads row 0 of 'x', which it is not given"
    );
}

#[test]
fn what_breaks_a_rule_is_named() {
    let fault = |change: &dyn Fn(&mut Tape)| {
        let mut tape = by_hand();
        change(&mut tape);
        tape.check().expect_err("a fault").0
    };
    let ends = |told: String, wanted: &str| assert!(told.ends_with(wanted), "{told}");
    ends(
        fault(&|t| t.operations[0] = Operation::Add(Id(0), Id(1))),
        "Id(0) does not come before it",
    );
    ends(
        fault(&|t| t.operations[0] = Operation::Load(row(7, 0))),
        "there is no buffer 7",
    );
    ends(
        fault(&|t| t.operations[0] = Operation::Load(row(0, 1))),
        "'x' has 1 rows",
    );
    ends(
        fault(&|t| t.operations[0] = Operation::Result(0, 0, 0)),
        "there is no call 0",
    );
    ends(
        fault(&|t| t.operations.push(Operation::Find(0, Id(0)))),
        "there is no table 0",
    );
    let choice = |t: &Tape| {
        t.operations
            .iter()
            .position(|o| matches!(o, Operation::Select(..)))
            .expect("a choice")
    };
    ends(
        fault(&|t| {
            let i = choice(t);
            t.operations[i] = Operation::Select(Id(0), Id(0), Id(0));
        }),
        "Id(0) gives a Number, not a Truth",
    );
    ends(
        fault(&|t| t.stores.push(t.stores[0])),
        "Row { buffer: 2, row: 0 } is written twice",
    );
    let shared = |t: &mut Tape| {
        t.stores[0] = Store {
            to: row(1, 0),
            value: Id(0),
        }
    };
    ends(fault(&shared), "all lanes share that row");
    ends(
        fault(&|t| t.buffers[0].name = "x; y".into()),
        "(a letter, then letters, digits and '_', at most 32)",
    );
    ends(
        fault(&|t| t.buffers[0].name = "y".into()),
        "there is another 'y'",
    );
    let table = Table {
        rows: vec![[0.0; 8]; 3],
        stride: 2,
    };
    ends(
        fault(&|t| t.tables.push(table.clone())),
        "and twice as many rows (one with 0)",
    );
}

#[test]
fn numbers_in_the_source_read_back_as_the_same_bits() {
    let numbers = [
        0.1,
        -0.0,
        1e-320,
        f64::MAX,
        2.0f64.powi(60),
        f64::INFINITY,
        1.0 / 3.0,
    ];
    let mut b = Builder::new();
    let y = b.buffer("y", numbers.len() as u16, false);
    let stores: Vec<(Row, Id)> = numbers
        .iter()
        .enumerate()
        .map(|(i, x)| (row(y, i as u16), b.constant(*x)))
        .collect();
    let source = b.finish(stores).source("numbers");
    for (i, x) in numbers.into_iter().enumerate() {
        let start = format!("y[{i} * lanes + lane] = ");
        let line = source
            .lines()
            .find_map(|l| l.strip_prefix(&start))
            .expect("a line");
        let text = line.trim_end_matches(';');
        let read = match text.strip_prefix("pf_from_bits(0x") {
            Some(bits) => f64::from_bits(
                u64::from_str_radix(bits.trim_end_matches("ull)"), 16).expect("bits"),
            ),
            None => text.trim_matches(['(', ')']).parse().expect("a number"),
        };
        assert_eq!(read.to_bits(), x.to_bits(), "{line}");
    }
}

#[test]
fn a_tape_reads_back_from_its_text_as_it_was() {
    let mut rows = [[f64::INFINITY; 8]; 4];
    rows[0] = [0.0, 0.1, -0.0, 1e-320, 3.0, 4.0, 5.0, 6.0];
    let mut b = Builder::new();
    let (x, y) = (b.buffer("x", 1, false), b.buffer("y", 1, false));
    let table = b.table(&rows, 2);
    let at = b.push(Operation::Load(row(x, 0)));
    let place = b.push(Operation::Find(table, at));
    let entry = b.push(Operation::Entry(table, place, 3));
    let two = b.constant(2.0);
    let power = b.push(Operation::PowerOfTwo(entry));
    let sign = b.push(Operation::CopySign(power, at));
    let least = b.push(Operation::Least(sign, two));
    let most = b.push(Operation::Largest(least, at));
    let searched = b.finish([(row(y, 0), most)]);
    for tape in [by_hand(), asks(), law(), searched] {
        let text = tape.to_string();
        let read = Tape::read(&text).unwrap_or_else(|fault| panic!("{fault}\n{text}"));
        assert_eq!(read.to_string(), text);
        assert_eq!(read.stores.len(), tape.stores.len());
    }
}

#[test]
fn what_a_person_writes_is_read_and_what_is_wrong_is_named_with_its_line() {
    let text = "plyflow-tape 1\n# half of the square, at most 10\nbuffer x 1\nbuffer y 1\na = load x 0\n\
        square = multiply a a\nhalf = multiply 0.5 square   # exact\nc = least half 10\nstore y 0 c\n";
    let tape = Tape::read(text).expect("a tape");
    let (mut x, mut y) = ([3.0, 100.0], [0.0; 2]);
    tape.run(2, &mut [&mut x, &mut y]);
    assert_eq!(y, [4.5, 10.0]);

    let fault = |from: &str, to: &str| Tape::read(&text.replace(from, to)).expect_err("a fault").0;
    assert_eq!(
        fault("plyflow-tape 1", "plyflow-tape 2"),
        "line 1: expected 'plyflow-tape 1'"
    );
    assert_eq!(
        fault("square = multiply a a", "square = multiply a b"),
        "line 6: 'b' is no number, nor the name of one before"
    );
    assert_eq!(
        fault("square = multiply a a", "square = square a"),
        "line 6: 'square' with 1 operands is no operation"
    );
    assert_eq!(
        fault("square = multiply a a", "a = multiply a a"),
        "line 6: there is another 'a'"
    );
    assert_eq!(
        fault("load x 0", "load z 0"),
        "line 5: there is no buffer 'z'"
    );
    assert_eq!(
        fault("load x 0", "load x -1"),
        "line 5: '-1' is no row (0 to 65535)"
    );
    assert_eq!(
        fault("c = least half 10", "c = select half a a"),
        "line 8: 'half' is no truth ('less' gives one)"
    );
    assert_eq!(
        fault("c = least half 10", "print c"),
        "line 8: 'print' begins no statement, or one with other words"
    );
    assert_eq!(
        fault("c = least half 10", "table t 2\nrow 1 2 3"),
        "line 9: expected 8 numbers after 'row'"
    );
    assert_eq!(
        fault("c = least half 10", "c = add nan inf"),
        "line 8: 'nan' is no number, nor the name of one before"
    );
    assert_eq!(
        fault("c = least half 10", "call law \u{1b}[31m"),
        "line 8: '?[31m' is no name (a letter, then letters, digits and '_', at most 32)"
    );
    let long = fault(
        "c = least half 10",
        &format!("c = least half {}", "x".repeat(5000)),
    );
    assert!(long.len() < 200, "{long}");
    assert!(fault("store y 0 c", "store y 1 c").ends_with("'y' has 1 rows"));
}

/// The page's examples stand for what strangers write.
#[test]
fn the_tape_of_the_page_does_what_the_page_says() {
    let page = include_str!("../../../../docs/plugins/tape.md");
    let block = page
        .split("```text\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next());
    let tape =
        Tape::read(block.expect("a block of text")).unwrap_or_else(|fault| panic!("{fault}"));
    let (mut metric, mut stress, mut energy, mut stiffness) =
        ([1.21, 1.0, 0.0], [9.0; 3], [9.0], [9.0; 2]);
    tape.run(
        1,
        &mut [&mut metric, &mut stress, &mut energy, &mut stiffness],
    );
    let e11 = 0.5 * (1.21 - 1.0);
    let wanted = [4e5 * e11, 0.0, 0.0];
    assert_eq!(
        (stress, energy, stiffness),
        (wanted, [0.5 * (wanted[0] * e11)], [4e5, 0.0])
    );
}

#[test]
fn no_text_of_a_stranger_breaks_the_reader() {
    let texts = [
        by_hand().to_string(),
        asks().to_string(),
        "plyflow-tape 1\ntable t 2\nrow 0 1 2 3 4 5 6 7\nbuffer x 1\na = load x 0\nb = find t a\n"
            .into(),
    ];
    let mut seed = 7u64;
    let mut next = |below: usize| {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % below
    };
    let words = [
        "buffer ",
        "x ",
        "y ",
        "0 ",
        "65535 ",
        "-1 ",
        "1e999 ",
        "0x7ff0000000000000 ",
        "= ",
        "load ",
        "find ",
        "call ",
        "result ",
        "store ",
        "row ",
        "\n",
        "v0",
        "v8",
    ];
    let (mut read, mut refused) = (0, 0);
    for i in 0..60_000 {
        let mut parts: Vec<&str> = texts[i % texts.len()]
            .split_inclusive([' ', '\n'])
            .collect();
        for _ in 0..=next(2) {
            let at = next(parts.len());
            match next(3) {
                0 => drop(parts.remove(at)),
                1 => parts[at] = words[next(words.len())],
                _ => parts.insert(at, words[next(words.len())]),
            }
        }
        match Tape::read(&parts.concat()) {
            Ok(tape) => {
                read += 1;
                let again =
                    Tape::read(&tape.to_string()).expect("what is read can be written and read");
                assert_eq!(again.to_string(), tape.to_string());
            }
            Err(_) => refused += 1,
        }
    }
    assert!(
        read > 500 && refused > 500,
        "{read} read, {refused} refused"
    );
    let many = (0..2000).fold("plyflow-tape 1\n".to_owned(), |text, i| {
        text + &format!("buffer b{i} 1\n")
    });
    assert_eq!(
        Tape::read(&many).expect_err("too many").0,
        "line 1002: more than 1000 buffers"
    );
}
