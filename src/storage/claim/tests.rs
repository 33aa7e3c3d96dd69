use super::*;
use std::sync::Mutex;

/// A claimant of a machine.
fn of(machine: &str, lease: f64) -> Claimant {
    Claimant { machine: Some(machine.to_string()), lease: Duration::from_secs_f64(lease) }
}

fn ours(claimant: &Claimant, directory: &Path, alone: bool) -> Claim {
    match claimant.take(directory, alone).unwrap() {
        Taken::Ours(claim, _) => claim,
        Taken::Held(holder) => panic!("held by {holder:?}"),
    }
}

fn is_held(claimant: &Claimant, directory: &Path, alone: bool) -> bool {
    matches!(claimant.take(directory, alone).unwrap(), Taken::Held(_))
}

/// Puts the last heartbeat of a claim back.
fn fall_silent(directory: &Path, number: u64, seconds: u64) {
    let file = OpenOptions::new().write(true).open(path(directory, number)).unwrap();
    file.set_modified(SystemTime::now() - Duration::from_secs(seconds)).unwrap();
}

fn entries(directory: &Path) -> usize {
    fs::read_dir(directory).unwrap().count()
}

#[test]
fn a_claim_is_held_released_and_cleared() {
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    let (a, b) = (of("a", 60.0), of("b", 60.0));
    let first = ours(&a, directory, true);
    assert!(first.is_ours().unwrap() && first.renew().unwrap() && first.number() == 1);
    assert!(is_held(&b, directory, true) && is_held(&b, directory, false) && is_held(&a, directory, false));
    let Standing::Held(Some(holder)) = b.standing(directory, true, 0).unwrap() else { panic!("not held") };
    assert_eq!((holder.owner.process(), holder.lease), (std::process::id(), Duration::from_secs(60)));
    assert!(holder.to_string().contains("lease 60 s"), "{holder}");
    // Whoever comes next need not wait.
    first.release();
    let second = ours(&b, directory, false);
    assert_eq!((second.number(), entries(directory)), (2, 2));
    assert!(!first.is_ours().unwrap() && !first.renew().unwrap());
    first.clear();
    assert_eq!(entries(directory), 2);
    second.clear();
    assert_eq!(entries(directory), 0);
    assert!(!second.renew().unwrap() && entries(directory) == 0);
    // A claim of the same number is another.
    let third = ours(&a, directory, false);
    assert!(third.is_ours().unwrap() && third.number() == 1 && !first.is_ours().unwrap());
}

#[test]
fn the_dead_lose_their_claims() {
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    let (a, b) = (of("a", 60.0), of("b", 5.0));
    let first = ours(&a, directory, true);
    // The lease is that of the claim, whoever comes.
    fall_silent(directory, 1, 30);
    assert!(is_held(&b, directory, true));
    fall_silent(directory, 1, 61);
    let Taken::Ours(second, Some(before)) = b.take(directory, true).unwrap() else { panic!("not taken over") };
    assert!(before.silent > before.lease && !first.renew().unwrap());
    // A lock that is ours proves that a process of this machine is dead, of others it says nothing.
    assert!(is_held(&a, directory, true) && is_held(&b, directory, false));
    let third = ours(&b, directory, true);
    assert!(!second.is_ours().unwrap() && third.is_ours().unwrap() && third.number() == 3);
    // Machines without a name are never the same.
    let nameless = Claimant { machine: None, ..b };
    third.release();
    let fourth = ours(&nameless, directory, true);
    assert!(is_held(&nameless, directory, true) && fourth.is_ours().unwrap());
    // One that was killed before it could write a word.
    fs::write(path(directory, 5), "").unwrap();
    assert!(is_held(&a, directory, true) && !fourth.is_ours().unwrap());
    fall_silent(directory, 5, 61);
    assert_eq!(ours(&a, directory, true).number(), 6);
    // A clock that was set back.
    let file = OpenOptions::new().write(true).open(path(directory, 6)).unwrap();
    file.set_modified(SystemTime::now() + Duration::from_secs(3600)).unwrap();
    assert_eq!(ours(&b, directory, true).number(), 7);
    assert!(a.take(&directory.join("none"), true).is_err());
}

#[test]
fn of_many_takers_one_succeeds() {
    let directory = tempfile::tempdir().unwrap();
    let taken: Mutex<Vec<u64>> = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for thread in 0..8 {
            let (taken, directory) = (&taken, directory.path());
            scope.spawn(move || {
                let claimant = of(&thread.to_string(), 60.0);
                let mut successes = 0;
                while successes < 25 {
                    if let Taken::Ours(claim, _) = claimant.take(directory, false).unwrap() {
                        assert!(claim.is_ours().unwrap());
                        taken.lock().unwrap().push(claim.number());
                        claim.release();
                        successes += 1;
                    }
                }
            });
        }
    });
    let taken = taken.into_inner().unwrap();
    // One after the other.
    assert_eq!(taken, (1..=200).collect::<Vec<u64>>());
    // Nothing but claims.
    assert_eq!(numbers(directory.path()).unwrap().len(), entries(directory.path()));
}

#[test]
fn others_files_are_no_claims() {
    let directory = tempfile::tempdir().unwrap();
    for name in [".lnn.claim.x", ".lnn.claim", "lnn.claim.3", ".lnn.lock"] {
        fs::write(directory.path().join(name), "x").unwrap();
    }
    assert_eq!(ours(&of("a", 1.0), directory.path(), true).number(), 1);
}
